"""Damage files of every format and see that every reader refuses them in one line.

python -m lab.fuzz --cases 1000

Files that do harm are kept, named by seed and number: the same numbers make them again.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from deeplight.errors import ConfigError


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.fuzz`."""

    cases: int = 1000
    """Damaged files of each format."""
    seed: int = 0
    """Of all random numbers; another one makes other files."""
    kinds: tuple[str, ...] = ()
    """Formats; left out, all that can be read here."""
    seconds: float = float("inf")
    """Stop after this number of seconds."""
    keep: Path = Path("out/fuzz")
    """Folder for the files that did harm."""


def run(args: Args) -> None:
    """Print what was tried and what did harm; exit code 1 if anything did."""
    from lab.fuzz.run import fuzz
    from lab.fuzz.seeds import available

    known = tuple(available())
    if unknown := sorted(set(args.kinds) - set(known)):
        do = f"give some of {', '.join(known)}"
        raise ConfigError("formats that can be read here", ", ".join(unknown), do)
    kinds = args.kinds or known
    with progress_bar("fuzzing", args.cases * len(kinds)) as advance:
        result = fuzz(kinds, args.cases, args.seed, args.seconds, args.keep, advance)
    for finding in result.findings:
        case = finding.case
        print(
            f"{args.keep}/{case.seed}-{case.number}.{case.kind}: {finding.reader}: {finding.what}"
        )
    print(
        f"{result.cases} files of {len(kinds)} formats, {result.refused} times refused, "
        f"{len(result.findings)} did harm; slowest {result.slowest_s:.1f} s, "
        f"most memory {result.largest_bytes / 1e6:.0f} MB"
    )
    if result.findings:
        sys.exit(1)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.fuzz", sys.modules[__name__], sys.argv[1:]))
