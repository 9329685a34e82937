"""The script for Unreal's editor, run against a stand-in that keeps what it is given.

What Unreal makes of it cannot be seen here; names and units are those of its Python documentation.
"""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeplight.environment import Environment
from deeplight.formats.files import FileSpec, write_environment
from deeplight.formats.labelled import labelled_environment
from deeplight.io.orientation import turned_from
from deeplight.io.radiance import read_hdr


class Component:
    """Takes properties; a name that Unreal's documentation does not list is refused."""

    listed: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.properties: dict[str, Any] = {}

    def set_editor_property(self, name: str, value: Any) -> None:
        assert name in self.listed, name
        self.properties[name] = value

    def set_mobility(self, mobility: str) -> None:
        self.mobility = mobility


class SkyLightComponent(Component):
    listed = (
        "source_type",
        "cubemap",
        "source_cubemap_angle",
        "cubemap_resolution",
        "lower_hemisphere_is_black",
        "intensity",
    )

    def recapture_sky(self) -> None:
        self.captured = dict(self.properties)


class DirectionalLightComponent(Component):
    listed = ("intensity", "light_source_angle")

    def set_light_color(self, colour: tuple[float, ...]) -> None:
        self.colour = colour


class Actor:
    def __init__(self, kind: type, rotation: Any) -> None:
        self.kind, self.rotation, self.tags = kind, rotation, []

    def set_actor_label(self, label: str) -> None:
        self.label = label

    def set_editor_property(self, name: str, value: Any) -> None:
        setattr(self, name, value)

    def get_component_by_class(self, kind: type) -> Component:
        self.component = kind()
        return self.component


class Editor:
    """The level and the asset tools."""

    def __init__(self) -> None:
        self.actors: list[Actor] = []
        self.imported: dict[str, Any] = {}

    def get_all_level_actors(self) -> list[Actor]:
        return list(self.actors)

    def destroy_actor(self, actor: Actor) -> None:
        self.actors.remove(actor)

    def spawn_actor_from_class(self, kind: type, place: Any, rotation: Any) -> Actor:
        self.actors.append(Actor(kind, rotation))
        return self.actors[-1]

    def import_asset_tasks(self, tasks: list[Any]) -> None:
        for task in tasks:
            self.imported = vars(task)
            task.imported_object_paths = ["/Game/deeplight/light"]


class Task:
    def set_editor_property(self, name: str, value: Any) -> None:
        setattr(self, name, value)

    def get_editor_property(self, name: str) -> Any:
        return getattr(self, name)


class Transaction:
    def __init__(self, what: str) -> None:
        pass

    def __enter__(self) -> None:
        pass

    def __exit__(self, *reason: object) -> None:
        pass


@pytest.fixture
def editor(monkeypatch: pytest.MonkeyPatch) -> Editor:
    level, module = Editor(), ModuleType("unreal")
    cube = type("TextureCube", (), {})
    stand_ins: dict[str, Any] = {
        "AssetImportTask": Task,
        "AssetToolsHelpers": SimpleNamespace(get_asset_tools=lambda: level),
        "ComponentMobility": SimpleNamespace(MOVABLE="movable"),
        "DirectionalLight": type("DirectionalLight", (), {}),
        "DirectionalLightComponent": DirectionalLightComponent,
        "EditorActorSubsystem": Editor,
        "LinearColor": lambda *values: values,
        "MathLibrary": SimpleNamespace(make_rot_from_x=lambda forward: forward),
        "Rotator": lambda: None,
        "ScopedEditorTransaction": Transaction,
        "SkyLight": type("SkyLight", (), {}),
        "SkyLightComponent": SkyLightComponent,
        "SkyLightSourceType": SimpleNamespace(SLS_SPECIFIED_CUBEMAP="cubemap"),
        "TextureCube": cube,
        "Vector": lambda *values: np.array(values, float),
        "get_editor_subsystem": lambda kind: level,
        "load_asset": lambda path: cube(),
    }
    for name, value in stand_ins.items():
        setattr(module, name, value)
    monkeypatch.setitem(sys.modules, "unreal", module)
    return level


def written(folder: Path) -> tuple[Environment, Path, Path]:
    light = labelled_environment(64)
    picture, script = write_environment(light, FileSpec(folder / "light.py", made_for="unreal"))
    return light, picture, script


def test_the_cube_and_the_suns_hold_the_whole_light_once(editor: Editor, tmp_path: Path) -> None:
    light, picture, script = written(tmp_path)
    runpy.run_path(str(script))
    assert editor.imported["filename"] == str(picture)
    sky, *suns = editor.actors
    assert sky.component.captured["intensity"] == 1
    assert sky.component.captured["lower_hemisphere_is_black"] is False
    assert len(suns) == len(light.lamps)
    for sun, one in zip(suns, light.lamps, strict=True):
        x, y, z = -one.direction  # Unreal: X ahead, Y right, Z up; a light shines along its X
        np.testing.assert_allclose(sun.rotation, [-z, x, y], atol=1e-6)
        given = np.array(sun.component.colour) * sun.component.properties["intensity"]
        np.testing.assert_allclose(given, one.irradiance, rtol=1e-5)
        angle = np.degrees(2 * one.angular_radius_rad)
        assert sun.component.properties["light_source_angle"] == pytest.approx(angle)
    shown = turned_from(read_hdr(picture), "unreal")
    np.testing.assert_allclose(shown, light.ambient, rtol=0.02, atol=0.01)
    assert np.abs(shown - light.radiance).max() > 1  # the lights are not in it


def test_another_run_replaces_what_the_first_one_brought(editor: Editor, tmp_path: Path) -> None:
    *_, script = written(tmp_path)
    runpy.run_path(str(script))
    count = len(editor.actors)
    editor.spawn_actor_from_class(object, None, None)  # the user's own
    runpy.run_path(str(script))
    assert len(editor.actors) == count + 1


def test_a_panorama_that_did_not_become_a_cube_is_said(editor: Editor, tmp_path: Path) -> None:
    *_, script = written(tmp_path)
    sys.modules["unreal"].load_asset = lambda path: None  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError, match="texture cube"):
        runpy.run_path(str(script))
    assert editor.actors == []
