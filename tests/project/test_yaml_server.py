"""The schema in a YAML editor: npm's yaml-language-server, which VS Code and others run, completes and checks by it."""

import asyncio
import shutil
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.lsp.client import LanguageClient

from cosim.project import starting

SERVER = shutil.which("yaml-language-server")
TEXT = """\
run: {stop: 1, step: 0.1}
blocks:
  wave: {block: Sine}
  controller:
    block: PID
    parametrs: {k_p: 1}
    parameters:
      k_q: 1
      
    inputs: {r: wave.y, y: 0}
"""  # noqa: W293  the line where somebody is about to write


@pytest.mark.skipif(not SERVER, reason="no yaml-language-server: npm install -g yaml-language-server")
def test_a_yaml_editor_completes_and_checks_by_the_schema(tmp_path):
    schema, path = tmp_path / "diagram.schema.json", tmp_path / "d.yaml"
    schema.write_text(starting.schema_text("diagram", tmp_path))
    path.write_text(TEXT)
    wrong, parameters, blocks = asyncio.run(asyncio.wait_for(session(schema, path, TEXT), 20))
    assert wrong == {5, 7}  # the misspelt key, and the parameter that a PID has not
    assert {"k_p", "k_i", "T_f"} <= parameters.keys() and "proportional gain" in parameters["k_p"]
    assert "PID controller" in blocks["PID"] and "NeuralObserver" in blocks


async def session(schema: Path, path: Path, text: str):
    client = LanguageClient("test", "1")
    told = asyncio.Event()
    found = []

    @client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
    def publish(params):
        found[:] = params.diagnostics
        if found:
            told.set()

    @client.feature(types.WORKSPACE_CONFIGURATION)
    def configuration(params):
        settings = {"schemas": {schema.as_uri(): "*.yaml"}, "validate": True, "completion": True}
        return [settings if item.section == "yaml" else {} for item in params.items]

    @client.feature(types.CLIENT_REGISTER_CAPABILITY)
    def register(params):
        return None

    await client.start_io(SERVER, "--stdio")
    capabilities = types.ClientCapabilities(workspace=types.WorkspaceClientCapabilities(configuration=True))
    await client.initialize_async(types.InitializeParams(capabilities, root_uri=path.parent.as_uri()))
    client.initialized(types.InitializedParams())
    document = types.TextDocumentItem(path.as_uri(), "yaml", 1, text)
    client.text_document_did_open(types.DidOpenTextDocumentParams(document))
    await told.wait()
    here = types.TextDocumentIdentifier(path.as_uri())

    async def offered(line, character):
        place = types.Position(line, character)
        answer = await client.text_document_completion_async(types.CompletionParams(here, place))
        items = answer if isinstance(answer, list) else answer.items
        return {item.label: str(getattr(item.documentation, "value", item.documentation)) for item in items}

    parameters, blocks = await offered(8, 6), await offered(4, 11)
    await client.shutdown_async(None)
    client.exit(None)
    await client.stop()
    return {diagnostic.range.start.line for diagnostic in found}, parameters, blocks
