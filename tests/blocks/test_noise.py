"""Noise: Philox's published vectors, the laws that the numbers follow, and that every run repeats them."""

import math

import numpy as np
import pytest

from cosim.authoring import random
from cosim.authoring.variables import State, Stream
from cosim.engine import run
from cosim.errors import CosimError, DeclarationError, WrongValue
from cosim.language.values import Value
from cosim.wiring.network import Signal
from cosim.wiring.revaluing import revalue

#: Of the known answers of Random123 (kat_vectors, philox4x32-10): counter, key, result.
KNOWN = (
    ((0,) * 4, (0,) * 2, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
)
NOISE = """
run: {stop: 40, step: 0.01}
fleets: {robot: 2}
blocks:
  white: {block: WhiteNoise, per: robot, period: 0.01, dimensions: {n: 2}, parameters: {seed: i, mean: 3, deviation: 2}}
  walk: {block: RandomWalk, period: 0.01, dimensions: {n: 50}, parameters: {seed: 10, intensity: 0.5}}
  band: {block: BandLimitedNoise, period: 0.01, dimensions: {n: 4}, parameters: {seed: 11, bandwidth: 5, deviation: 3}}
  flat: {block: UniformNoise, period: 0.01, parameters: {seed: 12, low: -1, high: 2}}
"""
SIGNALS = ("white.y", "walk.y", "band.y", "flat.y")


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN)
def test_philox_gives_the_published_words(counter, key, words):
    assert random.philox(*counter, *key) == words


def test_a_stream_gives_box_and_mullers_numbers_of_its_key_and_count():
    stream = [2**40 + 5, 0]
    random.begin(stream, 2**40 + 5)
    for count in range(3):
        a, b, c, d = (int(w) for w in random.philox(count, 0, 0, 0, 5, 2**8))
        first, second = (((high << 20) + (low >> 12)) * 2.0**-52 + 2.0**-53 for high, low in ((a, b), (c, d)))
        wanted = math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)
        assert random.normal(stream) == wanted and stream == [2**40 + 5, count + 1]


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    path = tmp_path_factory.mktemp("noise") / "noise.yaml"
    path.write_text(NOISE)
    return run.load(path)


def test_the_numbers_follow_their_laws(noise, trajectories):
    """Within 4 standard deviations of what 4,000 independent numbers of each kind show."""
    found = trajectories(noise, *SIGNALS)
    white = found["white.y"][1:4001].reshape(4000, 4)
    root = math.sqrt(4000)
    assert np.all(np.abs(white.mean(0) - 3.0) < 4 * 2.0 / root)
    assert np.all(np.abs(white.var(0) - 4.0) < 4 * 4.0 * math.sqrt(2) / root)
    unit = (white - white.mean(0)) / white.std(0)
    correlations = unit.T @ unit / 4000  # of members and elements
    assert np.abs(correlations - np.eye(4)).max() < 4 / root
    assert np.abs((unit[1:] * unit[:-1]).mean(0)).max() < 4 / root  # of one number and the next
    assert np.abs((unit**4).mean(0) - 3.0).max() < 4 * math.sqrt(24) / root  # as a normal law has it
    flat = found["flat.y"][1:4001]
    assert abs(flat.mean() - 0.5) < 4 * math.sqrt(9 / 12) / root and -1 < flat.min() < -0.99 and 1.99 < flat.max() < 2
    steps = np.diff(found["walk.y"][:4001], axis=0)
    assert abs(steps.var() / (0.25 * 0.01) - 1.0) < 4 * math.sqrt(2 / 200_000)
    assert abs((found["walk.y"][4000] ** 2).mean() / (0.25 * 40) - 1.0) < 4 * math.sqrt(2 / 50)
    band, kept = found["band.y"], math.exp(-2 * math.pi * 5 * 0.01)
    fresh = (band[1:4001] - kept * band[:4000]) / (3 * math.sqrt(1 - kept**2))
    assert abs(fresh.var() - 1.0) < 4 * math.sqrt(2 / 16_000) and abs(fresh.mean()) < 4 / math.sqrt(16_000)


def test_both_engines_draw_the_same_numbers(tmp_path, trajectories):
    (tmp_path / "noise.yaml").write_text(NOISE.replace("stop: 40", "stop: 0.2"))
    network = run.load(tmp_path / "noise.yaml")
    compiled, interpreted = trajectories(network, *SIGNALS), trajectories(network, *SIGNALS, engine="python")
    for name in SIGNALS:
        assert compiled[name].tobytes() == interpreted[name].tobytes() and np.ptp(compiled[name]) > 0.1, name


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("seed: 12", "seed: 11"), "flat has the seed 11 of band"),
        (("seed: i", "seed: 1"), "robot 2 of white has the seed 1 of robot 1 of white"),
        (("seed: 12, ", ""), "parameter `seed` of UniformNoise has no value"),
    ],
)
def test_no_two_draw_the_same_numbers(tmp_path, change, words):
    (tmp_path / "noise.yaml").write_text(NOISE.replace(*change))
    with pytest.raises(CosimError, match=words) as caught:
        run.load(tmp_path / "noise.yaml")
    assert isinstance(caught.value.errors[0], WrongValue) or "no value" in words


def test_a_study_that_gives_all_members_one_seed_is_told(noise):
    value = Value.of(7, noise.components["white"].entry.position)
    with pytest.raises(CosimError, match="robot 2 of white has the seed 7 of robot 1 of white"):
        revalue(noise, {Signal("white", "seed"): value})


def test_a_stream_that_nothing_begins_is_a_mistake():
    with pytest.raises(DeclarationError, match=r"no start\(\) begins the stream `stream`") as caught:

        class Own(random_block()):
            stream = Stream()

            def update(next_stream, next_y):
                next_y[0] = random.normal(next_stream)

    assert "random.begin(stream, seed)" in caught.value.fix


def test_drawing_from_the_state_itself_is_a_mistake():
    with pytest.raises(CosimError, match="writes `stream`, a state, which it may only read"):

        class Own(random_block()):
            stream = Stream()

            def start(stream):
                random.begin(stream, 1)

            def update(stream, next_y, next_stream):
                next_y[0] = random.normal(stream)
                next_stream[0] = 1


def random_block():
    from cosim.authoring.block import Block

    class Base(Block):
        y = State(output=True)

        def update(next_y):
            next_y[0] = 0.0

    return Base


def test_noise_is_a_scalar_that_is_added_to_a_signal_or_as_many_as_its_parameters_are(write, trajectories):
    text = """
    run: {stop: 1, step: 0.125}
    blocks:
      one: {block: WhiteNoise, period: 0.125, parameters: {seed: 5, mean: 1}}
      two: {block: WhiteNoise, period: 0.125, parameters: {seed: 6, deviation: [1, 3]}}
      sum: {block: Sum, inputs: {u_1: 2, u_2: one.y}}
    """
    found = trajectories(run.load(write(text)), "one.y", "two.y", "sum.y")
    assert found["one.y"].shape == (9,) and found["two.y"].shape == (9, 2)
    assert np.array_equal(found["sum.y"], 2.0 + found["one.y"]) and found["one.y"][0] == 1.0
    stream = [6, 0]
    random.begin(stream, 6)
    numbers = [random.normal(stream) for _ in range(16)]
    assert found["two.y"][1:].ravel().tolist() == [n * (1.0, 3.0)[k % 2] for k, n in enumerate(numbers)]
