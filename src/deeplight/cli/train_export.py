"""From a finished run to the model file that estimates."""

import sys
from pathlib import Path


def finish(run_dir: Path, data: str, path: Path | None) -> None:
    """Tell how far a run has come; write its best weights to `path` if there is one."""
    from deeplight.training import checkpoint

    best = run_dir / checkpoint.BEST
    if best.is_file():
        step = checkpoint.read_header(best).step
        sys.stdout.write(f"{run_dir}: best at step {step}; look at {run_dir / 'curves.png'}\n")
    if path is not None:
        export_run(run_dir, path, data.rstrip("/").rsplit("/", 1)[-1])
        sys.stdout.write(f"wrote {path}\n")


def export_run(run_dir: Path, path: Path, data: str = "", float16: bool = True) -> None:
    """Write the best weights of a run as an ONNX file with its contract."""
    from deeplight.deploy.onnx import export_onnx
    from deeplight.training.release import contract_of, load_best

    generator, header = load_best(run_dir)
    export_onnx(generator, contract_of(header, data), path, float16)
