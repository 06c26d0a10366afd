"""Nobody drives the page's server but its page: not without the token, from elsewhere, or by another name."""

import http.client
import json
import socket
from urllib.parse import urlsplit

import pytest

from cosim.watch.guard import Guard
from tests.watch.conftest import Watch


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """A page that is served, of a diagram that has a mistake, so that nothing is compiled."""
    folder = tmp_path_factory.mktemp("watched")
    (folder / "d.yaml").write_text("blocks: {a: {block: Nothing}}\n")
    with Watch(folder, "d.yaml") as watch:
        yield urlsplit(watch.address)


def ask(watched, path="", method="GET", body=None, **headers) -> int:
    """The status of an answer to a request with these headers, `_` for `-`."""
    connection = http.client.HTTPConnection(watched.hostname, watched.port, timeout=30)
    told = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, f"{watched.path}{path}", body, told)
    status = connection.getresponse().status
    connection.close()
    return status


def test_the_page_itself_is_answered(watched):
    here = f"http://127.0.0.1:{watched.port}"
    assert ask(watched) == ask(watched, "page.js") == ask(watched, "sliders", Sec_Fetch_Site="same-origin") == 200
    assert ask(watched, "slide", "POST", json.dumps({"values": {}}), Origin=here, Sec_Fetch_Site="same-origin") == 200
    assert ask(watched, Host=f"localhost:{watched.port}") == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},  # another program of this machine
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"Host": "evil.example"},  # a name that leads here: DNS rebinding
        {"Host": "127.0.0.1"},
        {"Host": "127.0.0.1.evil.example:80"},
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_strangers_page_is_refused_with_the_token_too(watched, headers, method):
    body = json.dumps({"values": {}}) if method == "POST" else None
    assert ask(watched, "slide" if method == "POST" else "sliders", method, body, **headers) == 403


@pytest.mark.parametrize("path", ["/", "//", "/sliders", "/x/sliders", "/%00/", "/%C3%A9/", "/events"])
def test_nothing_is_told_without_the_token(watched, path):
    assert ask(watched._replace(path=path)) == 403
    assert ask(watched._replace(path=watched.path[:-2] + "/")) == 403


def test_paths_lead_to_no_file(watched):
    for path in ("../../../etc/passwd", "page.css/../page.js", "%2e%2e/setup.py", "page.html", "runner.py"):
        assert ask(watched, path) in (400, 404)


def test_what_is_no_request_is_refused(watched):
    for body in (
        "",
        "{",
        "[]",
        "3",
        '{"values": {"a": "b"}}',
        '{"values": 3}',
        '{"runs": [0], "plots": [], "width": 1}',
    ):
        assert ask(watched, "slide", "POST", body) in (400, 413)
    assert ask(watched, "slide", "POST", Content_Length="2000000") == 413
    assert ask(watched) == 200


def test_it_listens_on_this_machine_alone(watched):
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in {*others, "127.0.0.2"}:
        with socket.socket() as tried:
            tried.settimeout(5)
            assert tried.connect_ex((address, watched.port)) != 0


def test_no_two_servers_have_one_token():
    assert len({Guard(1).token for _ in range(100)}) == 100 and len(Guard(1).token) >= 32
