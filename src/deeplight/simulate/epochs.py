"""Epochs of newly simulated takes: each a data set of its own seed, made when it is asked for."""

import json
import shutil
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from deeplight.dataset import DataSet, open_dataset
from deeplight.errors import ConfigError
from deeplight.jobs import LOCAL, Engine
from deeplight.simulate.run import Recipe, arranged, plan, simulate

KEPT = 2
"""Epochs that stay on the disk: the one that is learnt from, and the one before the next."""


class FilmedEpochs:
    """Epochs filmed in the training places of a folder of panoramas.

    Args:
        hdri: the panoramas.
        folder: where epochs lie while they are needed.
        recipe: of each; only training takes are filmed, each epoch with a seed of its own.
        engine: where to film.

    Raises:
        ConfigError: the recipe has no training takes.
        DataSetError: there are no panoramas.
    """

    def __init__(self, hdri: Path, folder: Path, recipe: Recipe, engine: Engine = LOCAL) -> None:
        if not recipe.train_takes:
            raise ConfigError("recipe.train_takes of at least 1", "0", "correct it")
        self.hdri, self.folder, self.engine = hdri, folder, engine
        self.recipe = replace(recipe, eval_takes=0, seen_takes=0)
        jobs, simulation, described = arranged(hdri, self.recipe)
        self.places = tuple(sorted({place.name for place in simulation.places["train"]}))
        self.length = sum(job.count for job in jobs)
        self.fingerprint = sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()

    def epoch(self, number: int) -> DataSet:
        """The data set of an epoch; killed in the middle, it goes on where it was.

        Raises:
            DataSetError: no panorama could be used.
            OSError: it cannot be written.
        """
        home = self._home(number)
        for old in sorted(self.folder.glob("epoch-*"))[:-KEPT]:
            if old < home:
                shutil.rmtree(old)
        shards, simulation = plan(self.hdri, home, self.recipe_of(number))
        simulate(shards, simulation, self.engine)
        return open_dataset(home)

    def recipe_of(self, number: int) -> Recipe:
        """The same for every epoch but for the seed."""
        own = np.random.SeedSequence([self.recipe.seed, number]).generate_state(1)
        return replace(self.recipe, seed=int(own[0]))

    def _home(self, number: int) -> Path:
        return self.folder / f"epoch-{number:06d}"
