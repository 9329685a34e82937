"""From clips to a data set: whole, resumed, grown, with broken files among them."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clips import GREYS, picture, write_clip
from deeplight.capture import clip as clip_module
from deeplight.capture.catalogue import find_clips
from deeplight.capture.choice import ChoiceSettings
from deeplight.capture.clip import CaptureSettings
from deeplight.capture.run import Outcome, capture, plan
from deeplight.cli.main import main
from deeplight.dataset import Manifest, open_dataset
from deeplight.errors import ConfigError, DataSetError
from deeplight.jobs import Engine

HERE = Engine(workers=1)
SETTINGS = CaptureSettings()


@pytest.fixture(autouse=True)
def known_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answer with the rig that was drawn, at once."""
    from clips import paper_located

    monkeypatch.setattr(clip_module, "locate", paper_located)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two clips of six frames in different places."""
    for name in ("one", "two"):
        frames = [picture(4 * n + 40 * (name == "two")) for n in range(6)]
        write_clip(tmp_path / "clips" / f"{name}.mp4", frames)
    return tmp_path / "clips"


def made(folder: Path, out: Path, settings: CaptureSettings = SETTINGS) -> Manifest:
    return capture(plan(find_clips([folder]), out, settings), HERE)


def report(out: Path, stem: str) -> dict:  # type: ignore[type-arg]
    return json.loads((out / "reports" / f"{stem}.json").read_text())


def digests(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_clips_become_a_data_set_with_a_rig_each(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "data"
    manifest = made(folder, out)
    data = open_dataset(out)
    data.verify()
    assert sum(manifest.examples(split) for split in manifest.splits) == 12
    assert {name[:3] for name in data.rigs} == {"one", "two"}
    for split in data.splits:
        for example in data.examples(split):
            assert example.meta.rig in data.rigs
            assert example.background.shape == (192, 135, 3)
            for name, grey in GREYS.items():
                mask = data.rigs[example.meta.rig].views[name].mask()
                middle = example.spheres[name][mask].astype(int)
                assert abs(np.median(middle) - grey) <= 4


def test_the_report_keeps_its_contract(folder: Path, tmp_path: Path) -> None:
    from deeplight.sphere import PAPER_RIG, SPHERES

    made(folder, tmp_path / "data")
    record = report(tmp_path / "data", "one")
    assert (record["status"], record["reason"]) == ("ok", "")
    assert record["frames"] == {"read": 6, "kept": 6, "dropped": {}}
    assert set(record["spheres"]) == set(SPHERES)
    for name, sphere in record["spheres"].items():
        view = PAPER_RIG.views[name]
        assert sphere["direction"] == pytest.approx(-view.ball_from_camera[2])
        assert sphere["angular_radius_rad"] == view.angular_radius_rad
    page = (tmp_path / "data" / "reports" / "one.html").read_text()
    assert page.count("<img") > 12
    assert "http" not in page
    assert 'href="one.html"' in (tmp_path / "data" / "reports" / "index.html").read_text()


def test_killed_in_the_middle_it_goes_on_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    made(folder, tmp_path / "whole")

    def kill(_: Outcome) -> None:
        raise KeyboardInterrupt

    broken = tmp_path / "broken"
    with pytest.raises(KeyboardInterrupt):
        capture(plan(find_clips([folder]), broken, SETTINGS), HERE, kill)
    with pytest.raises(DataSetError, match="unfinished"):
        open_dataset(broken)
    (broken / "reports" / ".one.12345678.html").write_text("half")
    again = plan(find_clips([folder]), broken, SETTINGS)
    assert len(again.missing) == 1
    capture(again, HERE)
    assert digests(broken) == digests(tmp_path / "whole")
    assert plan(find_clips([folder]), broken, SETTINGS).missing == ()


def test_clips_can_be_added_and_changed_ones_are_done_again(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "data"
    made(folder, out)
    before = digests(out)
    write_clip(folder / "a_new.mp4", [picture(4 * n + 80) for n in range(4)])
    grown = plan(find_clips([folder / "a_new.mp4"]), out, SETTINGS)
    assert [job.clip.stem for job in grown.missing] == ["a_new"]
    manifest = capture(grown, HERE)
    assert sum(manifest.examples(split) for split in manifest.splits) == 16
    assert {n: d for n, d in digests(out).items() if n in before and n.endswith(".tar")} == {
        n: d for n, d in before.items() if n.endswith(".tar")
    }
    write_clip(folder / "one.mp4", [picture(4 * n) for n in range(5)])
    changed = plan(find_clips([folder]), out, SETTINGS)
    assert [job.clip.stem for job in changed.missing] == ["one"]
    capture(changed, HERE)
    assert report(out, "one")["frames"]["kept"] == 5


def test_other_settings_need_another_folder(folder: Path, tmp_path: Path) -> None:
    made(folder, tmp_path / "data")
    other = replace(SETTINGS, choice=ChoiceSettings(alike=0.0))
    with pytest.raises(DataSetError, match="same settings"):
        plan(find_clips([folder]), tmp_path / "data", other)


def test_a_place_stays_in_its_split_when_clips_are_added(folder: Path, tmp_path: Path) -> None:
    made(folder, tmp_path / "data")
    table = tmp_path / "clips.csv"
    split = report(tmp_path / "data", "one")["split"]
    other = "test" if split == "train" else "train"
    table.write_text(f"clip,place,scene,split\ntwo.mp4,one,indoor,{other}\n")
    with pytest.raises(DataSetError, match="splits by place"):
        plan(find_clips([folder / "two.mp4"], table), tmp_path / "data", SETTINGS)


Damage = Callable[[Path], object]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:9000]), "truncated or damaged"),
        (lambda path: path.write_bytes(b""), "0 bytes long"),
        (lambda path: path.write_text("no video at all\n" * 50), "two.mp4, a text"),
        (lambda path: path.unlink(), "No such file"),
        (lambda path: write_audio(path), "without video"),
        (lambda path: write_clip(path, [np.zeros((320, 180, 3), np.uint8)] * 9), "good frames"),
    ],
    ids=["truncated", "empty", "text", "missing", "audio", "black"],
)
def test_a_bad_clip_is_recorded_and_the_others_are_done(
    folder: Path, tmp_path: Path, damage: Damage, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    damage(folder / "two.mp4")
    clips = [str(folder / f"{name}.mp4") for name in ("one", "two")]
    out = tmp_path / "data"
    assert main(["capture", *clips, "--out", str(out), "--workers", "1"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2
    assert "1 of 2 that cannot be used; the others are done" in lines[1]
    assert lines[0].startswith("deeplight capture: two.mp4: ")
    assert message in lines[0]
    failed = report(out, "two")
    assert failed["status"] == "failed"
    assert message in failed["reason"]
    assert failed["spheres"] == {}
    assert report(out, "one")["frames"]["kept"] == 6
    assert [item.file for item in open_dataset(out).manifest.skipped] == ["two.mp4"]


def write_audio(path: Path) -> None:
    """A container with sound only."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def test_nothing_usable_is_exit_2_and_the_reports_stay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.mp4").write_bytes(b"nonsense")
    words = ["capture", str(tmp_path / "a.mp4"), "--out", str(tmp_path / "data")]
    assert main(words) == 2
    assert "at least one usable clip" in capsys.readouterr().err
    assert report(tmp_path / "data", "a")["status"] == "failed"
    assert main(["capture", str(tmp_path / "a.mp4"), "--out", str(tmp_path), "--fov", "200"]) == 2
    assert "--fov" in capsys.readouterr().err


def test_the_surest_rig_can_be_saved_and_given_back(folder: Path, tmp_path: Path) -> None:
    from deeplight.capture.rig_file import read_rig_file
    from deeplight.sphere import Rig

    rig = tmp_path / "rig.json"
    words = ["capture", str(folder), "--out", str(tmp_path / "data"), "--workers", "1"]
    assert main([*words, "--save-rig", str(rig)]) == 0
    assert isinstance(read_rig_file(rig), Rig)
    words = ["capture", str(folder), "--out", str(tmp_path / "again"), "--workers", "1"]
    assert main([*words, "--rig", str(rig)]) == 0


def test_two_clips_of_one_name_are_refused_before_any_work(folder: Path, tmp_path: Path) -> None:
    write_clip(tmp_path / "other" / "one.mp4", [picture(0)])
    with pytest.raises(ConfigError, match="different names"):
        find_clips([folder, tmp_path / "other"])
