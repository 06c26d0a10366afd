"""Moving pictures: roles of signals, films, and a player that a browser plays without a network."""

import base64
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from cosim.errors import DiagramErrors, PlotError
from cosim.plot import animation, motion, player
from cosim.plot import scene as scenes
from cosim.plot.motion import Motion
from cosim.results.recorded import Recorded
from cosim.results.result_file import open_result
from cosim.results.result_writer import ResultWriter
from cosim.terminal.cli import main

pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra `plot`)")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
TIMES = np.linspace(0, 6, 61)
ROLES = "animation: {positions: swarm.pose, radii: swarm.size}"


def bodies(times=TIMES, count=3):
    angles = times[:, None] + np.arange(count) * 2 * np.pi / count
    return np.stack([np.cos(angles) + 0.3 * times[:, None], np.sin(angles), angles], axis=2)


@pytest.fixture
def run(tmp_path):
    def write(x, times=TIMES, diagram="", name="run", **more):
        arrays = {"swarm.pose": x, "swarm.size": np.full(x.shape[:2], 0.2), "other.x": 2 * x, **more}
        path = tmp_path / f"{name}.nc"
        signals = [Recorded(n, v.shape[1:], v.dtype, "robot", "m") for n, v in arrays.items()]
        with ResultWriter(path, signals, {"diagram": diagram} if diagram else {}) as writer:
            if len(times):
                writer.append(times, arrays)
        return path

    return write


def test_the_diagram_says_which_signals_move(run, tmp_path, capsys):
    path = run(bodies(), diagram=ROLES)
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.html")]) == 0
    assert capsys.readouterr().out.startswith("positions swarm.pose, radii swarm.size\n")
    plain = run(bodies(), name="plain")
    with open_result(plain) as opened:  # without a word, ports are known by their names
        assert motion.find(opened, Motion()).signals == {"positions": "other.x"}


def test_a_role_that_is_not_recorded_is_told(run, tmp_path, capsys):
    path = run(bodies(), diagram="animation: {positions: swarm.nowhere}")
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.html")]) == 2
    assert (
        "has not recorded `swarm.nowhere`, which its diagram names as `animation.positions`" in capsys.readouterr().err
    )


def test_roles_are_checked_in_the_diagram_and_kept_with_it(wired):
    net = wired("""
        run: {stop: 1, step: 0.1}
        blocks: {swing: {type: Oscillator, parameters: {w: 2}}}
        animation: {positions: swing.x}
        """)
    assert "animation: {positions: swing.x}" in net.diagram.resolved()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{positions: nobody.x}", "`nobody.x` names no block"),
        ("{positions: swing.nothing}", "nothing"),
        ("{posisions: swing.x}", "no key `posisions`"),
        ("{positions: 3}", "animation.positions"),
    ],
)
def test_a_role_that_names_nothing_is_a_mistake_of_the_diagram(wired, text, message):
    with pytest.raises(DiagramErrors) as caught:
        wired(f"""
            run: {{stop: 1, step: 0.1}}
            blocks: {{swing: {{type: Oscillator, parameters: {{w: 2}}}}}}
            animation: {text}
            """)
    assert message in str(caught.value)
    assert all(error.position and error.position.line == 4 for error in caught.value.errors)


def test_the_player_has_every_place_to_a_part_of_65_000(run):
    path = run(bodies(), diagram=ROLES)
    with open_result(path) as opened:
        moving = motion.read(opened, motion.find(opened, Motion()))
    packed = player.packed(moving)
    whole = np.frombuffer(base64.b64decode(packed["x"]), "<u2").reshape(61, 3, 2)
    places = np.array(packed["low"]) + whole * packed["scale"] / 65534
    np.testing.assert_allclose(places, bodies()[:, :, :2], atol=packed["scale"] / 65534)
    turns = np.frombuffer(base64.b64decode(packed["headings"]), "<u2") / 65534 * 2 * np.pi
    np.testing.assert_allclose(np.exp(1j * turns), np.exp(1j * bodies()[:, :, 2].ravel()), atol=2e-4)
    np.testing.assert_allclose(packed["times"], TIMES, rtol=1e-8)
    assert packed["radii"] == [0.2] * 3 and packed["unit"] == "m" and packed["name"] == "robot"


def test_long_runs_and_large_fleets_have_fewer_frames(run):
    times = np.linspace(0, 10, 3001)
    for x, most in ((bodies(times), 600), (bodies(times[:1000], 1000), 600)):
        moving = motion.Bodies(times[: len(x)], x, None, None, None, None, "m", "robot", 2.0)
        packed = player.packed(moving)
        assert 100 < len(packed["times"]) <= most and packed["times"][-1] == pytest.approx(times[len(x) - 1])
        assert len(json.dumps(packed)) < 1.5 * player.MOST_BYTES


def test_what_is_nowhere_is_in_no_frame(run):
    x = bodies()
    x[30:, 1] = np.nan
    with open_result(run(x, diagram=ROLES)) as opened:
        packed = player.packed(motion.read(opened, motion.find(opened, Motion())))
    whole = np.frombuffer(base64.b64decode(packed["x"]), "<u2").reshape(61, 3, 2)
    assert (whole[30:, 1] == player.NOWHERE).all() and (whole[:30] < player.NOWHERE).all()


@pytest.mark.parametrize("kind", ["gif", "html", "mp4"])
@pytest.mark.parametrize("count", [1, 2, 61])
def test_runs_of_one_sample_and_more_are_animated(run, tmp_path, kind, count):
    if kind == "mp4" and not animation.has_ffmpeg():
        pytest.skip("no ffmpeg: apt-get install ffmpeg")
    output = tmp_path / f"a.{kind}"
    with open_result(run(bodies()[:count], TIMES[:count], ROLES)) as opened:
        animation.animate(opened, Motion(), output, seconds=1, frames=5)
        animation.animate(opened, Motion(), output, seconds=1, frames=5)  # over one of ours
    data = output.read_bytes()
    assert (
        data[4:8] == b"ftyp" if kind == "mp4" else data.startswith(b"GIF89a" if kind == "gif" else b"<!doctype html>")
    )
    if kind == "gif":
        from PIL import Image

        with Image.open(output) as image:
            assert image.n_frames == min(count, 5)


@pytest.mark.parametrize("kind", ["gif", "html", "mp4"])
def test_somebody_elses_file_stays(run, tmp_path, kind, capsys):
    if kind == "mp4" and not animation.has_ffmpeg():
        pytest.skip("no ffmpeg: apt-get install ffmpeg")
    output = tmp_path / f"a.{kind}"
    output.write_bytes(b"GIF89a somebody's")
    assert main(["plot", str(run(bodies(), diagram=ROLES)), "--animate", "-o", str(output)]) == 2
    assert "it is not replaced" in capsys.readouterr().err and output.read_bytes() == b"GIF89a somebody's"


def test_without_ffmpeg_there_is_a_gif_and_a_word(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(animation.shutil, "which", lambda name: None)
    path = run(bodies()[:3], TIMES[:3], ROLES)
    assert main(["plot", str(path), "--animate"]) == 0
    assert "a GIF, as ffmpeg is not installed" in capsys.readouterr().out
    assert path.with_suffix(".gif").read_bytes().startswith(b"GIF89a")
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.mp4")]) == 2
    assert "needs ffmpeg" in capsys.readouterr().err and not (tmp_path / "a.mp4").exists()


def test_a_run_without_samples_has_no_animation(run, tmp_path):
    with open_result(run(np.zeros((0, 3, 2)), [], ROLES)) as opened, pytest.raises(PlotError, match="has no samples"):
        animation.animate(opened, Motion(), tmp_path / "a.gif")


def test_each_frame_shows_its_own_time(run):
    with open_result(run(bodies(), diagram=ROLES)) as opened:
        scene = scenes.scene(motion.read(opened, motion.find(opened, Motion())))
        first, again, last = animation._pictures(scene, np.array([0, 0, 60]))
    assert first.tobytes() == again.tobytes() != last.tobytes()


def test_a_crowd_is_drawn_as_one_and_where_it_is():
    x = bodies(count=1000)
    neighbours = np.full((61, 1000, 2), -1, np.int32)
    neighbours[:, 5, 0] = 7
    moving = motion.Bodies(TIMES, x, None, None, neighbours, None, "m", "robot", 2.0)
    crowd = scenes.scene(moving)
    first, last = animation._pictures(crowd, np.array([0, 60]))
    np.testing.assert_array_equal(crowd.discs.get_offsets(), x[60, :, :2])
    (edge,) = crowd.edges.get_segments()
    np.testing.assert_array_equal(edge, x[60, [7, 5], :2])
    assert len(crowd.ways.get_segments()) == 1000 and first.tobytes() != last.tobytes()


def test_a_browser_plays_stops_and_scrubs_without_a_network(run, tmp_path):
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no browser: apt-get install chromium")
    neighbours = np.tile(np.array([[1, -1], [2, -1], [0, 1]], np.int32), (61, 1, 1))
    path = run(bodies(), diagram=ROLES[:-1] + ", neighbours: net.neighbours}", **{"net.neighbours": neighbours})
    with open_result(path) as opened:
        animation.animate(opened, Motion(), tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    assert not re.search(r"https?:|src=|href=", text)
    script = """<script>addEventListener("load", () => {
      const root = document.querySelector(".player"), canvas = root.querySelector("canvas");
      const ink = () => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
      const differ = (a, b) => a.some((v, k) => v !== b[k]);
      const before = ink(), seen = [];
      root.cosim.show(30);
      const middle = ink();
      seen.push(differ(before, middle) ? "moved" : "still", root.querySelector("output").textContent);
      root.querySelector("input").value = 60;
      root.querySelector("input").dispatchEvent(new Event("input"));
      seen.push(root.cosim.at, differ(middle, ink()) ? "scrubbed" : "still");
      root.querySelector("button").click();
      seen.push(root.cosim.playing, root.cosim.at);
      root.querySelector("button").click();
      seen.push(root.cosim.playing, root.querySelector("button").textContent);
      document.body.setAttribute("data-seen", seen.join(", "));
    })</script>"""
    page = tmp_path / "watched.html"
    page.write_text(text.replace("</html>", script + "</html>"))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND"]
    command = [browser, *options, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert 'data-seen="moved, t = 3.00 s, 60, scrubbed, true, 0, false, play"' in dom
