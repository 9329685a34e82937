"""A measurement on disk: the bases, the certificate, a picture."""

from dataclasses import asdict
from pathlib import Path

from deeplight.errors import ConfigError
from deeplight.io.basis_file import save_bases
from deeplight.io.light_stage_file import write_json
from deeplight.io.photos import write_png
from deeplight.light_stage.measure import Measured, MeasureSettings
from deeplight.light_stage.picture import basis_picture


def check_name(path: Path) -> None:
    """Refuse a name that would be overlooked later; ConfigError."""
    if path.suffix != ".npz" or path.is_dir():
        raise ConfigError("a name ending in .npz", f"{path}", "rename the output")


def write_measured(
    path: Path, measured: Measured, folder: Path, how: MeasureSettings
) -> tuple[Path, ...]:
    """Write `path`, `<stem>.certificate.json` and `<stem>.picture.png`, each whole or not at all.

    Returns:
        The files written, the basis last: where it is, the others are.

    Raises:
        OSError: a file cannot be written.
    """
    certificate = measured.certificate.to_dict()
    settings = {key: str(v) if isinstance(v, Path) else v for key, v in asdict(how).items()}
    certificate_path = path.with_name(f"{path.stem}.certificate.json")
    picture = path.with_name(f"{path.stem}.picture.png")
    write_json(certificate_path, certificate)
    write_png(picture, basis_picture(measured.bases))
    provenance = {"folder": folder.name, "settings": settings, "certificate": certificate}
    save_bases(path, measured.bases, provenance)
    return certificate_path, picture, path
