"""Our KTX2 files read by ktx-parse, the library that three.js and glTF Transform read them with.

`make round-trip` installs it with three; `DEEPLIGHT_NODE_MODULES` names the folder.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from deeplight.environment import Environment
from deeplight.formats.files import FileSpec, write_environment
from deeplight.formats.labelled import labelled_environment
from deeplight.io.orientation import faces_for
from deeplight.mappings.layouts import cube_from_latlong

MODULES = os.environ.get("DEEPLIGHT_NODE_MODULES", "")
PARSER = Path(MODULES) / "three/examples/jsm/libs/ktx-parse.module.js"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not MODULES or not PARSER.exists() or shutil.which("node") is None,
        reason="needs node, and DEEPLIGHT_NODE_MODULES with three: make round-trip",
    ),
]
READ = """
import { readFileSync } from 'node:fs';
const { read } = await import(process.argv[1]);
const file = read(new Uint8Array(readFileSync(process.argv[2])));
const [level] = file.levels, [block] = file.dataFormatDescriptor;
const data = Buffer.from(level.levelData);
console.log(JSON.stringify({ ...file, levels: file.levels.length, block,
  keys: Object.keys(file.keyValue), orientation: file.keyValue.KTXorientation,
  texels: data.toString('base64'), dataFormatDescriptor: null, globalData: null }));
"""


@pytest.fixture(scope="module")
def environment() -> Environment:
    return labelled_environment(64)


def parsed(path: Path) -> dict:
    command = ["node", "--input-type=module", "-e", READ, str(PARSER.resolve()), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return json.loads(done.stdout)


def test_ktx_parse_reads_the_cube_as_it_was_written(
    environment: Environment, tmp_path: Path
) -> None:
    import base64

    (path,) = write_environment(environment, FileSpec(tmp_path / "a.ktx2", size=16))
    file = parsed(path)
    assert (file["vkFormat"], file["pixelWidth"], file["faceCount"]) == (109, 16, 6)
    assert file["orientation"].rstrip("\0") == "rd"
    assert file["keys"] == ["KTXorientation", "KTXwriter", "deeplight:unit"]
    channels = [sample["channelType"] & 15 for sample in file["block"]["samples"]]
    assert channels == [0, 1, 2, 15]
    assert file["block"]["transferFunction"] == 1  # linear
    stored = np.frombuffer(base64.b64decode(file["texels"]), "<f4").reshape(6, 16, 16, 4)
    faces = faces_for(cube_from_latlong(environment.radiance, 16), "webxr")
    np.testing.assert_array_equal(stored[..., :3], faces.astype(np.float32))


def test_ktx_parse_refuses_a_damaged_file(environment: Environment, tmp_path: Path) -> None:
    """The twin: the parser does look."""
    (path,) = write_environment(environment, FileSpec(tmp_path / "a.ktx2", size=16))
    path.write_bytes(b"\0" + path.read_bytes()[1:])
    with pytest.raises(subprocess.CalledProcessError):
        parsed(path)
