"""The contract every verb shares: exit codes, one line of complaint, help, quick start."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

from deeplight.cli import main as dispatcher
from deeplight.cli.main import VERBS, main
from deeplight.dataset.manifest import MANIFEST
from deeplight.errors import ImageFileError

COMMAND = [sys.executable, "-m", "deeplight"]


@dataclass(frozen=True)
class FakeArgs:
    """What the made-up verb takes."""

    photo: str = "photo.jpg"


Run = Callable[[FakeArgs], None]


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> Callable[[Run], None]:
    """Put a made-up verb `fake` in the table; give the function that says what it does."""

    def make(run: Run) -> None:
        module = ModuleType("deeplight.cli.fake", "Do what a test says.\n\nExample: deeplight fake")
        module.Args, module.run = FakeArgs, run  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "deeplight.cli.fake", module)
        monkeypatch.setitem(VERBS, "fake", "made up")

    return make


def failing(error: BaseException) -> Run:
    def run(args: FakeArgs) -> None:
        raise error

    return run


def test_a_verb_gets_its_arguments_and_exits_0(verb: Callable[[Run], None]) -> None:
    seen: list[FakeArgs] = []
    verb(seen.append)
    assert main(["fake", "--photo", "other.jpg"]) == 0
    assert seen == [FakeArgs("other.jpg")]


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (ImageFileError("a photo", "text", "look"), "expected a photo; got text; look"),
        (
            FileNotFoundError(2, "No such file or directory", "a.jpg"),
            "a.jpg: No such file or directory",
        ),
        (OSError(28, "No space left on device"), "No space left on device"),
        (OSError("cannot write x.exr:\n disk full?"), "cannot write x.exr: disk full?"),
        (
            ModuleNotFoundError("No module named 'torch'", name="torch.nn"),
            "expected the optional packages of 'train' for `deeplight fake`; "
            'got an installation without them; run: pip install ".[train]" in deeplight\'s folder',
        ),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    verb: Callable[[Run], None],
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    line: str,
) -> None:
    verb(failing(error))
    assert main(["fake"]) == 2
    captured = capsys.readouterr()
    assert captured.err == f"deeplight fake: {line}\n"
    assert captured.out == ""


@pytest.mark.parametrize("bug", [ValueError("oops"), ModuleNotFoundError("x", name="deeplight.x")])
def test_a_bug_keeps_its_traceback(verb: Callable[[Run], None], bug: Exception) -> None:
    verb(failing(bug))
    with pytest.raises(type(bug)):
        main(["fake"])


def test_ctrl_c_is_one_line_and_130(
    verb: Callable[[Run], None], capsys: pytest.CaptureFixture[str]
) -> None:
    verb(failing(KeyboardInterrupt()))
    assert main(["fake"]) == 130
    assert capsys.readouterr().err == "deeplight fake: interrupted\n"


def test_a_closed_pipe_is_silent() -> None:
    read, write = os.pipe()
    os.close(read)
    code = (
        "import sys, types; from deeplight.cli import main as m; v = types.ModuleType('f', 'x');"
        "v.Args = type('Args', (), {}); v.run = lambda args: sys.stdout.write('x' * 100_000);"
        "sys.modules['deeplight.cli.fake'] = v; m.VERBS['fake'] = 'x';"
        "m._parse = lambda *words: None; sys.exit(m.main(['fake']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_an_unknown_verb_is_met_with_a_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimat"]) == 2
    assert capsys.readouterr().err == "deeplight: 'estimat' is no verb; did you mean 'estimate'?\n"
    assert main(["zzzzzz"]) == 2
    assert "one of: estimate" in capsys.readouterr().err
    assert main([]) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["estimate", "photo.jpg", "--fill", "nonsense"], "'indoor'"),
        (["estimate", "photo.jpg", "--fil", "none"], "meant: --fill"),
        (["estimate", "photo.jpg", "--height", "tall"], "--height"),
        (["convert"], "Missing from deeplight convert: --out"),
        (["convert", "--no-such-flag"], "--no-such-flag"),
    ],
)
def test_an_argument_that_cannot_be_is_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"deeplight {words[0]}: ")
    assert said in line
    assert line.endswith(f"; see deeplight {words[0]} --help")


def test_help_shows_the_module_docstring(
    verb: Callable[[Run], None], capsys: pytest.CaptureFixture[str]
) -> None:
    verb(lambda args: None)
    with pytest.raises(SystemExit) as left:
        main(["fake", "--help"])
    assert left.value.code == 0
    assert "Example: deeplight fake" in capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(VERBS))
def test_every_verb_has_help_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main([name, "--help"])
    assert left.value.code == 0
    said = capsys.readouterr().out
    assert "(default: )" not in said
    lines = [line.strip() for line in said.splitlines()]
    assert [line for line in lines if line.startswith(f"deeplight {name} ")]
    assert not [line for line in lines if line.count(f"deeplight {name} ") > 1]  # one a line


def test_every_verb_is_one_file(root: Path) -> None:
    files = {path.stem for path in (root / "src" / "deeplight" / "cli").glob("*.py")}
    assert files == {*VERBS, "__init__", "main", "screen", "stopping", "flags"}


@pytest.mark.parametrize("flag", ["--help", "--version"])
def test_the_program_starts_without_its_verbs(flag: str) -> None:
    code = (
        "import sys; from deeplight.cli.main import main; code = main(sys.argv[1:]);"
        "heavy = {'tyro', 'rich', 'numpy', 'torch', 'onnxruntime'} & set(sys.modules);"
        "sys.exit(f'loaded {heavy}' if heavy else code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, flag], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "deeplight" in done.stdout


def test_python_m_deeplight_is_the_command() -> None:
    done = subprocess.run([*COMMAND, "nonsense"], capture_output=True, text=True, check=False)
    assert done.returncode == dispatcher.BAD_INPUT
    assert done.stderr.startswith("deeplight: 'nonsense' is no verb")


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What makes a flag useless: a data set, photographs that are linear, a panorama."""
    folder = tmp_path_factory.mktemp("given")
    (folder / MANIFEST).touch()
    (folder / "stage" / "diffuse").mkdir(parents=True)
    (folder / "stage" / "diffuse" / "0.exr").touch()
    xmp = b'<x:xmpmeta GPano:ProjectionType="equirectangular"/>'
    Image.new("RGB", (64, 32)).save(folder / "panorama.jpg", xmp=xmp)
    return folder


@pytest.mark.parametrize(
    ("words", "unused"),
    [
        ("benchmark --split test", "--split without --data"),
        ("evaluate --data x --hdri y", "--hdri without --benchmark"),
        ("transfer a.obj --out b --silver None --roughness 0.5", "--roughness with --silver None"),
        ("transfer a.obj --out b --ground None --ground-points 9", "--ground-points with"),
        ("export a.onnx --out b.onnx --photos 9", "--photos with --precision float32"),
        ("export a.onnx --out b.onnx --calibrate x", "--calibrate with --precision float32"),
        ("probe a.jpg --out b.exr --card-reflectance 0.5", "--card-reflectance without --card"),
        ("probe a.jpg --out b.exr --shows panorama --ball 1 2 3", "--ball with --shows panorama"),
        ("demo --export x --port 80", "--port with --export"),
        ("demo --at https://example.org/", "--at without --export"),
        ("convert a.hdr --test-panorama --out b.exr", "IN with --test-panorama"),
        ("convert --test-panorama --out b.exr --from unity", "--from with --test-panorama"),
        ("simulate --hdri x --out y --ray-address auto", "an address only with --engine ray"),
        ("capture a.mp4 --out y --ray-address auto", "an address only with --engine ray"),
        ("estimate a.jpg --light-only --seen", "--light-only"),
        ("estimate a.jpg --sun 0 40 --shadow-top 1 2", "no --shadow"),
        ("compose a.jpg --out b.png --layers c.png", "--layers FILE.exr for a photo"),
        ("calibrate GIVEN --out m.onnx --captured x", "--captured with data sets"),
        ("calibrate GIVEN --out m.onnx --fov 50", "--fov with data sets"),
        ("reflectance GIVEN/stage --out b.npz --gamma 1.8", "--gamma with photographs"),
        ("reflectance GIVEN/stage --out b.npz --linear", "--linear with photographs"),
        ("fuse GIVEN/panorama.jpg --out x --fov 50", "--fov with panoramas"),
        ("study make --method a=x --method b=y --out z --reference r", "--reference without"),
    ],
)
def test_a_flag_that_is_not_used_is_refused(
    words, unused, given, capfd, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words.replace("GIVEN", str(given)).split()) == 2
    assert unused in capfd.readouterr().err.replace("expected ", "")
    assert list(tmp_path.iterdir()) == []
