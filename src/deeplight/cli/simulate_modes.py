"""What `deeplight simulate` does and prints, one function for each kind of result."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from deeplight.engine import Engine
from deeplight.errors import ConfigError
from deeplight.simulate.film.recipe import FilmRecipe
from deeplight.simulate.light_stage import LightStage
from deeplight.simulate.run import Recipe
from deeplight.simulate.worlds.settings import Worlds

if TYPE_CHECKING:
    from deeplight.cli.simulate import Args


def make(args: "Args") -> None:
    """Do what the options ask for."""
    console = Console()
    if args.rooms or args.skies:
        worlds(args.out, args.rooms, args.skies, args.worlds, console)
    elif args.light_stage:
        light_stage(args.out, args.stage, console)
    elif args.video:
        films(args.hdri, args.out, args.film, console)
    else:
        engine = Engine(args.engine, args.workers, args.ray_address)
        data_set(args.hdri, args.out, args.recipe, engine, console)


def data_set(
    hdri: Path | None, out: Path, recipe: Recipe, engine: Engine, console: Console
) -> None:
    """Film a data set and its contact sheet."""
    from deeplight.dataset import open_dataset
    from deeplight.dataset.contact_sheet import write_contact_sheet
    from deeplight.simulate.run import plan, simulate

    shards, simulation = plan(_panoramas(hdri), out, recipe)
    missing = sum(job.count for job in shards.missing())
    start = time.perf_counter()
    with _bar(console) as bar:
        task = bar.add_task("filming", total=missing)
        manifest = simulate(shards, simulation, engine, lambda n: bar.advance(task, n))
    seconds = time.perf_counter() - start
    sheet = write_contact_sheet(open_dataset(out), out / "contact_sheet.png")
    for split in manifest.splits:
        console.print(
            f"{split}: {manifest.examples(split)} in {len(manifest.places(split))} places"
        )
    for item in manifest.skipped:
        console.print(escape(f"skipped {item.file}: {item.reason}"), style="yellow")
    console.print(f"{missing / seconds:.0f} images/s; look at {sheet}")


def films(hdri: Path | None, out: Path, recipe: FilmRecipe, console: Console) -> None:
    """Film clips and their truth."""
    from deeplight.simulate.film.run import film_all, plan_films

    plan = plan_films(_panoramas(hdri), out, recipe)
    with _bar(console) as bar:
        task = bar.add_task("filming", total=len(plan.missing()) * recipe.frames)
        skipped = film_all(plan, lambda frames: bar.advance(task, frames))
    for item in skipped:
        console.print(escape(f"skipped {item.file}: {item.reason}"), style="yellow")
    made = len(plan.jobs) - len(plan.missing())
    console.print(escape(f"{made} clips and their truth in {out / 'clips'}"))


def light_stage(out: Path, stage: LightStage, console: Console) -> None:
    """Photograph spheres under single lights."""
    from deeplight.simulate.light_stage import photographs_of, write_light_stage

    with _bar(console) as bar:
        task = bar.add_task("photographing", total=photographs_of(stage))
        lights = write_light_stage(out, stage, lambda n: bar.advance(task, n))
    spheres = ", ".join(stage.materials)
    console.print(escape(f"{spheres} under {len(lights.files)} lights in {out}"), soft_wrap=True)


def worlds(out: Path, rooms: int, skies: int, settings: Worlds, console: Console) -> None:
    """Make rooms and skies."""
    from deeplight.simulate.worlds.run import make_worlds

    with _bar(console) as bar:
        task = bar.add_task("making places", total=rooms + skies)
        count = make_worlds(out, rooms, skies, settings, lambda n: bar.advance(task, n))
    console.print(escape(f"{count} panoramas in {out}; film in them with --hdri {out}"))


def _panoramas(hdri: Path | None) -> Path:
    if hdri is None:
        raise ConfigError("--hdri, a folder of HDR panoramas", "none", "give one")
    return hdri


def _bar(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, TimeRemainingColumn(), console=console)
