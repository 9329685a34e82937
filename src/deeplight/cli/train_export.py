"""From a finished run to the model file that estimates."""

from pathlib import Path


def export_run(run_dir: Path, path: Path, data: str = "", float16: bool = True) -> None:
    """Write the best weights of a run as an ONNX file with its contract."""
    from deeplight.export.onnx import export_onnx
    from deeplight.training.release import contract_of, load_best

    generator, header = load_best(run_dir)
    export_onnx(generator, contract_of(header, data), path, float16)
