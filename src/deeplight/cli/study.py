"""Ask people which pictures look right, and rank the methods by their answers.

deeplight study make --method ours=a --method theirs=b --out study

deeplight study analyse answers/ --study study --out results

make: the pictures of one scene have one name in every folder. Put study/site on any web space or
hand it over as it is; keep study/key.json. People get their answers as a file and send it to you.
analyse: prints the ranking; with --out also report.html (look at it), results.json, strengths.png.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from deeplight.cli.flags import Repeated, flat, refuse_unused
from deeplight.study.design import Sitting


@dataclass(frozen=True)
class Make:
    """Write the page that people open, and the key to its codes."""

    method: Repeated
    """NAME=FOLDER of a method's pictures; at least two."""
    out: Path
    """Folder of the study: site/ and key.json."""
    question: Literal["real", "reference"] = "real"
    """Which looks more real, or which is closer to the reference."""
    reference: Path | None = None
    """Folder of reference pictures, for that question."""
    session: Sitting = field(default_factory=Sitting)
    """What one person is shown."""
    title: str = "Which picture?"
    """Heading of the page."""
    consent: Path | None = None
    """Text file that people agree to; left out, a plain one."""
    contact: str = ""
    """Whom people may ask: a name, an address."""
    seed: int = 0
    """Of the codes."""


@dataclass(frozen=True)
class Analyse:
    """Rank the methods by people's answers."""

    answers: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FILE...", help_behavior_hint="(one or more)"),
    ]
    """Answer files, or folders of them."""
    study: Path
    """Folder that `make` wrote, or its key.json."""
    out: Path | None = None
    """Folder for the report and all files."""


Args = (
    Annotated[Make, tyro.conf.subcommand("make")]
    | Annotated[Analyse, tyro.conf.subcommand("analyse")]
)


def run(args: Make | Analyse) -> None:
    if isinstance(args, Make):
        _make(args)
    else:
        _analyse(args)


def _make(args: Make) -> None:
    from deeplight.cli.screen import results_console
    from deeplight.io.atomic import results_folder
    from deeplight.study.design import SITE, Study, make_study, named_folders

    if args.question != "reference":
        refuse_unused(args, "without --question reference", "reference")
    study = Study(
        named_folders(flat(args.method)),
        args.question,
        args.reference,
        args.session,
        args.title,
        args.consent.read_text(encoding="utf-8") if args.consent else "",
        args.contact,
        args.seed,
    )
    with results_folder(args.out):
        key = make_study(study, args.out)
    console = results_console()
    scenes, methods = len(key["scenes"]), len(key["conditions"])
    console.print(f"{methods} methods, {scenes} scenes, {args.session.total} pairs for each person")
    console.print(f"try {args.out / SITE / 'index.html'}")


def _analyse(args: Analyse) -> None:
    from deeplight.cli.screen import results_console
    from deeplight.io.atomic import results_folder
    from deeplight.study.analyse import analyse, summary_lines, write_findings
    from deeplight.study.answers import Key, read_people

    key = Key.load(args.study)
    findings = analyse(read_people(args.answers, key), key)
    console = results_console()
    for line in summary_lines(findings):
        console.print(line)
    if args.out is not None:
        with results_folder(args.out):
            write_findings(findings, args.out)
        console.print(f"look at {args.out / 'report.html'}")
