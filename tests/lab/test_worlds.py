"""Made-up rooms and skies: laws of their light, and that what is traced lies where it should."""

import csv
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.cli.main import main, run_command
from deeplight.dataset import open_dataset
from deeplight.errors import ConfigError
from deeplight.mappings import latlong
from lab.worlds import paint
from lab.worlds.landscape import DOME_ROWS, clear_sky, direct_light, draw_landscape, overcast_sky
from lab.worlds.room import draw_room
from lab.worlds.run import make_worlds, world_of
from lab.worlds.settings import Worlds
from lab.worlds.world import Dome, LightGroup, Sun, World, direction_towards, panel

SUN = direction_towards(2.0, 0.7)


def test_the_sun_reddens_and_fades_as_it_sinks_and_in_haze() -> None:
    light = [direct_light(np.radians(degrees), 3.0) for degrees in (80, 40, 10, 2)]
    assert all((high > low).all() for high, low in pairwise(light))
    redness = [red / blue for red, _, blue in light]
    assert redness == sorted(redness)
    assert 60 < light[0] @ LUMINANCE < 128  # 1,000 lux at noon: less than above the air
    assert direct_light(0.7, 8.0) @ LUMINANCE < 0.8 * direct_light(0.7, 2.0) @ LUMINANCE


def test_a_clear_sky_is_bright_at_the_sun_and_blue_away_from_it() -> None:
    sky = clear_sky(np.array(SUN), 3.0)
    directions = latlong.directions(DOME_ROWS, 2 * DOME_ROWS)
    luminance = sky @ LUMINANCE
    assert directions.reshape(-1, 3)[luminance.argmax()] @ SUN > 0.98
    away = np.array([-SUN[0], SUN[1], -SUN[2]])
    at = np.unravel_index((directions @ away).argmax(), luminance.shape)
    assert sky[at][2] > 1.3 * sky[at][0]
    assert 0.5 < luminance[at] < 15  # 1,000 cd/m2
    assert not sky[directions[..., 1] < 0].any()


def test_an_overcast_sky_is_three_times_as_bright_above() -> None:
    sky = np.mean([overcast_sky(np.random.default_rng(n)) for n in range(8)], axis=0)[..., 0]
    level, zenith = sky[DOME_ROWS // 2 - 1].mean(), sky[0].mean()
    assert zenith / level == pytest.approx(3, rel=0.15)


def test_paints_are_albedos() -> None:
    rng = np.random.default_rng(0)
    colour = paint.colour_like(rng, (0.1, 0.8), 0.3)
    for texture in (
        paint.mottled(rng, colour, 0.5),
        paint.tiled(rng, colour, 7, 5, bond=True),
        paint.facade(rng, paint.warm(rng, (0.1, 0.6)), 3, 4),
    ):
        assert paint.DARKEST <= texture.min() < texture.max() <= paint.BRIGHTEST
    outside = paint.view_outside(rng, 4.0)
    assert outside[:8].mean() > outside[-8:].mean()  # sky above


@pytest.mark.parametrize("draw", [draw_room, draw_landscape])
def test_a_seed_decides_a_place(draw) -> None:  # type: ignore[no-untyped-def]
    first, again, other = (draw(np.random.default_rng(n)) for n in (1, 1, 2))
    assert first.eye == again.eye != other.eye
    for a, b in zip(first.surfaces, again.surfaces, strict=True):
        np.testing.assert_array_equal(a.paint, b.paint)
    for moods in (first.moods, other.moods):
        assert all(set(gains) <= set(first.groups) | set(other.groups) for gains in moods.values())


def test_panels_of_a_room_face_its_inside() -> None:
    room = draw_room(np.random.default_rng(3))
    panels = [s for s in room.surfaces if s.form == "panel"]
    assert len(panels) >= 6
    for surface in panels:
        matrix = surface.world_from_shape
        assert (np.array(room.eye) - matrix[:3, 3]) @ matrix[:3, 2] > 0


def open_ground(albedo: float = 0.5) -> World:
    """A plane under a sun and an even dome."""
    ground = panel((-50, 0, 50), (100, 0, 0), (0, 0, -100), paint.plain([albedo] * 3))
    groups = {
        "sun": LightGroup([Sun(SUN, 3.0)]),
        "dome": LightGroup([Dome(np.ones((8, 16, 3), np.float32))]),
        "side": LightGroup([Dome(clear_sky(np.array(SUN), 3.0))]),
    }
    moods = {
        "sun": {"sun": (1.0, 1.0, 1.0)},
        "dome": {"dome": (1.0, 0.5, 2.0)},
        "side": {"side": (1.0, 1.0, 1.0)},
        "all": {"sun": (2.0, 2.0, 2.0), "dome": (3.0, 1.5, 6.0), "side": (1.0, 1.0, 1.0)},
    }
    return World("outdoor", (0.0, 1.5, 0.0), [ground], groups, moods)


@pytest.fixture(scope="module")
def traced() -> dict[str, np.ndarray]:
    pytest.importorskip("mitsuba")
    from lab.worlds.trace import panoramas

    return panoramas(open_ground(), 64, 16, 0)


def test_ground_reflects_what_falls_on_it(traced: dict[str, np.ndarray]) -> None:
    below = traced["sun"][60:].mean((0, 1))
    np.testing.assert_allclose(below, 0.5 * 3.0 * SUN[1] / np.pi, rtol=0.02)
    np.testing.assert_allclose(traced["dome"][60:].mean((0, 1)), [0.5, 0.25, 1.0], rtol=0.05)


def test_the_sun_is_where_it_was_put_with_its_irradiance(traced: dict[str, np.ndarray]) -> None:
    above = np.where(latlong.directions(64, 128)[..., 1] > 0, traced["sun"][..., 0], 0)
    directions = latlong.directions(64, 128)
    assert directions.reshape(-1, 3)[above.argmax()] @ SUN > 0.99
    assert (above * latlong.solid_angles(64, 128)).sum() == pytest.approx(3.0, rel=0.02)
    mirrored = np.array([-SUN[0], SUN[1], SUN[2]])
    assert directions.reshape(-1, 3)[above.argmax()] @ mirrored < 0.9


def test_the_sky_is_turned_as_the_sun_is(traced: dict[str, np.ndarray]) -> None:
    luminance = traced["side"] @ LUMINANCE
    assert latlong.directions(64, 128).reshape(-1, 3)[luminance.argmax()] @ SUN > 0.95


def test_moods_add_up_their_groups(traced: dict[str, np.ndarray]) -> None:
    together = 2 * traced["sun"] + 3 * traced["dome"] + traced["side"]
    np.testing.assert_allclose(traced["all"], together, rtol=1e-4, atol=1e-5)


def test_made_places_can_be_filmed(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    made, out = tmp_path / "made", tmp_path / "sim"
    words = f"--out {made} --skies 1 --worlds.height 64 --worlds.samples 1"
    assert run_command("python -m lab.worlds", "lab.worlds.__main__", words.split()) == 0
    rows = list(csv.DictReader((made / "manifest.csv").open()))
    assert {row["split"] for row in rows} == {"train"}
    assert len({row["place"] for row in rows}) == 1
    before = {p.name: p.stat().st_mtime_ns for p in made.glob("*.exr")}
    assert make_worlds(made, 0, 1, Worlds(64, 1)) == len(before)  # nothing is made twice
    assert before == {p.name: p.stat().st_mtime_ns for p in made.glob("*.exr")}
    film = f"simulate --hdri {made} --out {out} --workers 1 --recipe.train-takes 1"
    assert main([*film.split(), *"--recipe.frames 1 --recipe.varied 1".split()]) == 0
    index = open_dataset(out).index("train")
    assert len(index) == len(rows)
    assert index[0].meta.details["varied"] is True


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "worlds.json").write_text(json.dumps({"seed": 5}))
    with pytest.raises(ConfigError, match="another folder"):
        make_worlds(tmp_path, 1, 0, Worlds(64, 1))
    other = tmp_path / "photographed"
    other.mkdir()
    (other / "manifest.csv").write_text("file,split,place,scene\n")
    with pytest.raises(ConfigError, match="another folder"):
        make_worlds(other, 1, 0, Worlds(64, 1))
    with pytest.raises(ConfigError):
        Worlds(height=8)


def test_places_do_not_depend_on_how_many_there_are() -> None:
    assert world_of("room", 7, 0).eye == world_of("room", 7, 0).eye != world_of("room", 8, 0).eye
