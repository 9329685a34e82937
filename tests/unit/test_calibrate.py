"""`deeplight calibrate`: the gains of another phone are found, put into the model, or refused."""

from functools import partial

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("onnx")

from deeplight.calibrate.gains import GRID, ClipViews, GainCalibration, find_gains, shrunk, views_of
from deeplight.calibrate.model import write_with_gains
from deeplight.camera_response import encode
from deeplight.cli.main import main
from deeplight.contract import ModelContract
from deeplight.dataset import Example, ExampleMeta, ShardJob, open_dataset
from deeplight.errors import InputError, ModelError
from deeplight.estimators.calibration import Calibration
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.scores import rendered_radiance
from deeplight.io.exif import MAKE, MODEL
from deeplight.preprocess import normalise
from deeplight.reflectance import rig_bases
from deeplight.sphere import PAPER_RIG
from toy_data import write_toy_data

TRUE_GAINS = np.array([0.25, 0.0, -0.3])
BASES = rig_bases(PAPER_RIG)


def photos(count, seed=0):
    shape = (count, 192, 135, 3)
    return np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)


class Even:
    """A model that sees one even light, whatever the photo."""

    name = "even"

    def estimate_inputs(self, inputs):
        return np.full((len(inputs), 32, 32, 3), np.log(0.3), np.float32)


def filmed(places, log_gains, noise=0.0, seed=1):
    """Spheres filmed in an even light times gains, which noise moves from place to place."""
    names = np.repeat(np.array(places), 2)
    random = np.random.default_rng(seed)
    moved = {place: random.normal(0, noise, 3) for place in places}
    light = np.full((len(names), 32, 32, 3), np.log(0.3), np.float32)
    rendered = rendered_radiance(BASES, light)
    gain = np.exp([log_gains + moved[name] for name in names]).astype(np.float32)[:, None, None]
    pixels = {name: encode(np.clip(values * gain, 0, 1)) for name, values in rendered.items()}
    return ClipViews(names, rendered, pixels, BASES)


def test_the_gains_of_a_phone_are_found_wherever_it_filmed():
    found = find_gains([filmed(("a", "b"), TRUE_GAINS), filmed(("c", "d"), TRUE_GAINS)])
    np.testing.assert_allclose(found.log_gains, TRUE_GAINS, atol=0.01)
    assert found.places == 4
    for name, value in found.after.items():
        assert value < 0.1 * found.before[name]


def test_what_only_chance_says_is_refused():
    """Places that differ from each other and not from the model on the whole."""
    with pytest.raises(InputError, match="nothing was written"):
        find_gains([filmed(tuple("abcdef"), np.zeros(3), noise=0.2)])
    # The twin: the same chance on top of what the phone does.
    assert find_gains([filmed(tuple("abcdef"), 3 * TRUE_GAINS, noise=0.2)]).places == 6


def test_two_places_are_too_few():
    with pytest.raises(InputError, match="at least 3 places"):
        find_gains([filmed(("a", "b"), TRUE_GAINS)])


def test_brightness_and_colour_are_believed_apart():
    gains = np.array([[0.3, 0.0, -0.6]])
    np.testing.assert_allclose(shrunk(gains, 1, 0), np.full((1, 3), gains.mean()))
    np.testing.assert_allclose(shrunk(gains, 0, 1).sum(), 0, atol=1e-12)
    np.testing.assert_allclose(shrunk(gains, 0.5, 0.5), gains / 2)
    assert GRID[len(GRID) // 2] == pytest.approx(0, abs=1e-6)


def moved(model, gains, folder):
    """By how much ln radiance moves beyond the gains; and the number of lamps, before and after."""
    out = folder / "mine.onnx"
    write_with_gains(model, out, tuple(gains), "")
    inputs = np.random.default_rng(0).uniform(-0.5, 0.5, (1, 3, 192, 135)).astype(np.float32)
    before, after = (
        OnnxEstimator(path, trusted=True).estimate_fully(inputs) for path in (model, out)
    )
    return np.abs(after[0] - before[0] - gains), len(before[1][0]), len(after[1][0])


def test_a_model_that_uses_its_layers_twice_is_moved_once(flipped_model, tmp_path):
    error, lamps, still = moved(flipped_model, np.full(3, 0.25), tmp_path)
    assert error.max() < 1e-3
    assert lamps == still
    # Lamps agree by luminance, which the gains' colour changes: where they shine, a little.
    error, *_ = moved(flipped_model, TRUE_GAINS, tmp_path)
    assert np.quantile(error, 0.85) < 1e-3


@pytest.mark.slow
def test_the_shipped_model_with_flips_is_moved_once(root, tmp_path):
    shipped = root / "src" / "deeplight" / "weights" / "deeplight.onnx"
    both = tmp_path / "both.onnx"
    assert main(["export", str(shipped), "--flips", "--out", str(both)]) == 0
    error, lamps, still = moved(both, TRUE_GAINS, tmp_path)
    assert error.max() < 0.01
    assert lamps == still


def test_the_model_gives_the_same_light_times_the_gains(root, tmp_path):
    """Lamps included; nothing else moves; and its network is read back with them."""
    shipped = root / "src" / "deeplight" / "weights" / "deeplight.onnx"
    out = tmp_path / "mine.onnx"
    write_with_gains(shipped, out, tuple(TRUE_GAINS), "mine")
    before, after = (OnnxEstimator(path, trusted=True) for path in (shipped, out))
    inputs = np.random.default_rng(0).uniform(-0.5, 0.5, (2, 3, 192, 135)).astype(np.float32)
    light, lamps, _ = before.estimate_fully(inputs)
    moved, their_lamps, _ = after.estimate_fully(inputs)
    np.testing.assert_allclose(moved, light + TRUE_GAINS, atol=1e-4)
    for own, theirs in zip(lamps[0], their_lamps[0], strict=True):
        np.testing.assert_allclose(theirs.flux, own.flux * np.exp(TRUE_GAINS), rtol=1e-3)
    assert after.contract.trained_on.endswith("; mine")
    assert after.contract.lamps == before.contract.lamps
    if pytest.importorskip("torch"):
        import torch

        from deeplight.training.model_file import load_network

        with torch.no_grad():
            read = load_network(out)[0](torch.from_numpy(inputs)).permute(0, 2, 3, 1).numpy()
        np.testing.assert_allclose(read, moved, atol=1e-3)


def taken_with(make, model, folder):
    """A photo's file that names its camera."""
    picture, path = Image.fromarray(photos(1, 7)[0]), folder / "photo.jpg"
    exif = picture.getexif()
    exif[MAKE], exif[MODEL] = make, model
    picture.save(path, exif=exif)
    return path


CAMERAS = [
    ("Acme", "One", True),
    ("ACME", "Acme  one", True),
    ("Acme", "Two", False),
    ("Other", "One", False),
    ("", "", True),
]


@pytest.fixture(scope="module")
def both_models(root, tmp_path_factory):
    """A model with lamps as it was, and calibrated for one camera."""
    shipped = root / "src" / "deeplight" / "weights" / "deeplight.onnx"
    out = tmp_path_factory.mktemp("both") / "mine.onnx"
    write_with_gains(shipped, out, tuple(TRUE_GAINS), "mine", "Acme One")
    return OnnxEstimator(shipped), OnnxEstimator(out, trusted=True)


@pytest.mark.parametrize(("make", "model", "counts"), CAMERAS)
def test_gains_count_for_photos_of_their_camera(both_models, tmp_path, make, model, counts):
    """Others have the light and lamps from before; who names no camera has the gains."""
    photo = taken_with(make, model, tmp_path)
    before, after = (estimator.explain(photo, 66) for estimator in both_models)
    wanted = TRUE_GAINS if counts else np.zeros(3)
    expected = before.lighting.radiance * np.exp(wanted)
    np.testing.assert_allclose(after.lighting.radiance, expected, rtol=1e-4)
    for own, theirs in zip(before.lamps, after.lamps, strict=True):
        np.testing.assert_allclose(theirs.flux, own.flux * np.exp(wanted), rtol=1e-3)
    notes = [note for note in after.notes if "calibrated for Acme One" in note]
    assert bool(notes) != bool(make and counts)


@pytest.mark.parametrize(("use", "counts"), [("always", True), ("never", False)])
def test_who_says_when_gains_count_is_obeyed(both_models, tmp_path, monkeypatch, use, counts):
    before, after = both_models
    monkeypatch.setattr(after, "calibrated", use)
    wanted = TRUE_GAINS if counts else np.zeros(3)
    for camera in (("Acme", "One"), ("Acme", "Two")):
        photo = taken_with(*camera, tmp_path)
        was, now = (estimator.explain(photo, 66).lighting.radiance for estimator in both_models)
        np.testing.assert_allclose(now, was * np.exp(wanted), rtol=1e-4)
    inputs = normalise(photos(1))
    shift = after.estimate_inputs(inputs) - before.estimate_inputs(inputs)
    np.testing.assert_allclose(shift, np.broadcast_to(wanted, shift.shape), atol=1e-4)


def test_gains_on_gains_are_left_out_together(root, tmp_path):
    first, second = tmp_path / "first.onnx", tmp_path / "second.onnx"
    tiny = root / "tests" / "golden" / "tiny.onnx"
    write_with_gains(tiny, first, tuple(TRUE_GAINS), "", "Acme One")
    write_with_gains(first, second, (0.1, 0.2, 0.3), "", "Acme Two")
    photo = taken_with("Acme", "One", tmp_path)
    was, now = (OnnxEstimator(m, trusted=True).explain(photo, 66).lighting for m in (tiny, second))
    np.testing.assert_allclose(now.radiance, was.radiance, rtol=1e-4)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"log_gains": [1, 2], "camera": "a"}', '{"log_gains": 1, "camera": ""}',
     '{"log_gains": [1, 2, NaN], "camera": ""}', '{"log_gains": [1, 2, 99], "camera": ""}',
     '{"log_gains": [1, 2, 3], "camera": 4}'],
)  # fmt: skip
def test_a_broken_calibration_is_refused(text):
    with pytest.raises(ModelError):
        Calibration.from_json(text)


def test_the_flag_needs_a_calibrated_model(tmp_path, capfd):
    photo = taken_with("Acme", "One", tmp_path)
    words = ["estimate", str(photo), "--calibrated", "never", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "--calibrated never" in line


def tinted(job: ShardJob, camera=lambda number: ""):
    """The spheres are brighter and redder than the tiny network says, in every place."""
    for number in range(job.first, job.first + job.count):
        photo = photos(1, number)[0]
        spheres = {
            name: np.full((32, 32, 3), (200, 120, 60), np.uint8)
            for name in ("mirror", "matte_silver", "diffuse")
        }
        meta = ExampleMeta(
            f"{job.split}-{number}",
            "take",
            number,
            "indoor",
            job.split,
            "paper",
            "mine",
            "CC0",
            "-",
            {"camera": camera(number)},
        )
        yield Example(f"{job.split}-{number}", photo, spheres, meta)


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    return write_toy_data(tmp_path_factory.mktemp("clips"), {"train": 4, "val_indoor": 4}, tinted)


def test_the_command_writes_a_better_model(root, clips, tmp_path, capfd):
    tiny, out = root / "tests" / "golden" / "tiny.onnx", tmp_path / "mine.onnx"
    words = ["calibrate", str(clips), "--weights", str(tiny), "--out", str(out)]
    assert main(words) == 0
    assert "left out in turn" in capfd.readouterr().out
    wanted = 2.2 * np.log(200 / 60)  # how much redder than blue the spheres are
    redder = []
    for model in (tiny, out):
        light = np.exp(
            OnnxEstimator(model, trusted=True).estimate_inputs(np.stack([normalise(photos(1))[0]]))
        )
        redder.append(np.log(light[..., 0].mean() / light[..., 2].mean()))
    assert abs(redder[1] - wanted) < 0.5 * abs(redder[0] - wanted)


def test_the_clips_say_which_camera_they_are_of(root, tmp_path, capfd):
    """Or the command does, by name or by a photo; clips of two are refused."""
    tiny, out = root / "tests" / "golden" / "tiny.onnx", tmp_path / "mine.onnx"
    examples = partial(tinted, camera=lambda number: "Acme One" if number else "")
    clips = write_toy_data(tmp_path / "one", {"train": 4}, examples)
    start = ["calibrate", str(clips), "--weights", str(tiny), "--out", str(out)]
    photo = taken_with("Acme", "Two", tmp_path)
    named = (((), "Acme One"), (("--camera", "any"), ""), (("--camera", str(photo)), "Acme Two"))
    for words, camera in named:
        assert main([*start, *words]) == 0
        calibration = OnnxEstimator(out, trusted=True).calibration
        assert calibration is not None
        assert calibration.camera == camera
    examples = partial(tinted, camera=lambda number: f"Acme {number % 2}")
    other = write_toy_data(tmp_path / "two", {"train": 4}, examples)
    capfd.readouterr()
    assert main(["calibrate", str(other), "--weights", str(tiny), "--out", str(out)]) == 2
    assert "Acme 0 and Acme 1" in capfd.readouterr().err


def test_without_clips_it_says_so(tmp_path, capfd):
    assert main(["calibrate", "--out", str(tmp_path / "a.onnx")]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "expected clips of the spheres" in line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--out", "a.tflite"), "--out FILE.onnx"),
        (("--weights", "b.onnx", "--out", "a.onnx"), "b."),
    ],
)
def test_what_cannot_be_used_is_one_line(clips, tmp_path, monkeypatch, capfd, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", str(clips), *words]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert message in line
    assert not list(tmp_path.iterdir())


def test_an_out_that_cannot_be_written_is_said_before_the_clips_are_looked_at(tmp_path, capfd):
    (tmp_path / "a.onnx").mkdir()
    assert main(["calibrate", str(tmp_path / "no.mp4"), "--out", str(tmp_path / "a.onnx")]) == 2
    assert f"{tmp_path / 'a.onnx'}" in capfd.readouterr().err


def test_every_split_of_the_clips_is_looked_at(clips):
    views = views_of(Even(), open_dataset(clips))
    assert sum(len(part.places) for part in views) == 8
    assert isinstance(find_gains(views), GainCalibration)


def test_a_network_of_others_is_refused(tmp_path):
    import onnx
    from onnx import helper

    model = helper.make_model(helper.make_graph([], "none", [], []))
    onnx.save(model, str(tmp_path / "other.onnx"))
    with pytest.raises(InputError, match="of deeplight"):
        write_with_gains(tmp_path / "other.onnx", tmp_path / "a.onnx", (0, 0, 0), "")
    assert ModelContract().trained_on == ""
