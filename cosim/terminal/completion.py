"""Completion in shells: the scripts that ask this program what may come next, and where each shell looks for one."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import UsageError, nearest
from cosim.terminal import completing

MARK = "# Completion of `cosim`, written by `cosim --install-completion`."
BASH = """\
_cosim() {
    local IFS=$'\\n'
    COMPREPLY=($(cosim --complete bash "${COMP_LINE:0:COMP_POINT}" 2>/dev/null))
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[/=.] ]] && compopt -o nospace
}
complete -o nosort -F _cosim cosim
"""
ZSH = """\
#compdef cosim
_cosim() {
    local -a whole parts
    local line
    for line in "${(@f)$(cosim --complete zsh "$LBUFFER" 2>/dev/null)}"; do
        [[ -z $line ]] && continue
        if [[ $line == *[/=.] ]]; then parts+=("$line"); else whole+=("$line"); fi
    done
    compadd -Q -S "" -- $parts
    compadd -Q -- $whole
}
compdef _cosim cosim
"""
FISH = """\
complete -c cosim -f -a '(cosim --complete fish (commandline -cp) 2>/dev/null)'
"""


_SPECIAL = re.compile(r"""[\s\\"'$&|;()<>*?`!#\[\]{}~]""")


@dataclass(frozen=True)
class Shell:
    """script: the text. place: its file, from the folder that `home` gives. advice: what a person does then."""

    script: str
    home: Callable[[], Path]
    place: str
    advice: str


def _data() -> Path:
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")


def _configuration() -> Path:
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")


SHELLS = {
    "bash": Shell(
        BASH,
        _data,
        "bash-completion/completions/cosim",
        "a new shell knows it where bash-completion is installed; else add to ~/.bashrc:  source {file}",
    ),
    "zsh": Shell(ZSH, _data, "cosim/completion.zsh", "add to the end of ~/.zshrc, after compinit:  source {file}"),
    "fish": Shell(FISH, _configuration, "fish/completions/cosim.fish", "a new shell knows it"),
}


def install(name: str | None) -> None:
    """Write the script of a shell where it looks for it, and say what is to be done.

    Raises: UsageError for an unknown shell, where a file is not ours to replace, or cannot be written.
    """
    from cosim.terminal.screen import say  # which `answer` has no time for

    wanted = name or Path(os.environ.get("SHELL", "")).name
    if wanted not in SHELLS:
        said = f"there is no completion for `{wanted}`" if wanted else "$SHELL does not say which shell this is"
        raise UsageError(said, fix=f"{nearest(wanted, SHELLS)}, as in: cosim --install-completion bash")
    shell = SHELLS[wanted]
    path = shell.home() / shell.place
    first, _, rest = shell.script.partition("\n")
    text = f"{first}\n{MARK}\n{rest}" if first.startswith("#compdef") else f"{MARK}\n{shell.script}"
    try:
        if path.exists() and MARK not in path.read_text(encoding="utf-8", errors="replace"):
            raise UsageError(f"{path} is there already, and is not ours", fix="remove it if you mean it")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(
            f"{error.filename or path}: {error.strerror}", fix="see that the folder can be written"
        ) from None
    say(f"completion for {wanted} is written to {path}")
    say(shell.advice.format(file=path))


def answer(shell: str, line: str) -> str:
    """What may stand at the end of a line, a word a line, as a shell takes it."""
    typed, found = completing.candidates(line)
    if shell == "fish":
        return "".join(f"{word}\t{help_}\n" for word, help_ in found.items())
    begin = max(typed.rfind(sign) for sign in "=:") + 1 if shell == "bash" else 0  # at which bash breaks words
    return "".join(f"{_quoted(word[begin:])}\n" for word in found)


def _quoted(word: str) -> str:
    """A word in which a shell sees nothing of its own but a home folder at its begin."""
    home = "~" if word.startswith("~") else ""
    return home + _SPECIAL.sub(r"\\\g<0>", word[len(home) :])
