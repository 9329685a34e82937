"""A certificate for this machine, so that phones of the local network give the page their camera.

Nobody else vouches for it: each phone asks once whether to trust it, and shows its fingerprint.
"""

import hashlib
import shutil
import socket
import ssl
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from deeplight.errors import ConfigError

DAYS = 30
_NOWHERE = ("192.0.2.1", 9)  # an address for examples: nothing is sent there
_TUNNEL = "cloudflared tunnel --url http://localhost:8765 --http-host-header localhost"


def local_address() -> str:
    """This machine's address in the local network; 127.0.0.1 where it is in none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_NOWHERE)  # of UDP: the system only looks up the way
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])


def own_certificate(address: str) -> tuple[ssl.SSLContext, str]:
    """Make a key and a certificate that last as long as the program; give them and a fingerprint.

    Args:
        address: that the page is asked by, besides this machine's names.

    Raises:
        ConfigError: there is no openssl, or it fails.
    """
    if shutil.which("openssl") is None:
        raise ConfigError(
            "openssl, which makes the certificate", "none", f"install it, or run: {_TUNNEL}"
        )
    host = socket.gethostname()
    names = ["DNS:localhost", f"DNS:{host}", f"DNS:{host}.local", f"IP:{address}", "IP:127.0.0.1"]
    with TemporaryDirectory(prefix="deeplight-") as folder:
        certificate, key = Path(folder, "certificate.pem"), Path(folder, "key.pem")
        command = [
            *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"),
            *("-nodes", "-keyout", str(key), "-out", str(certificate), "-days", f"{DAYS}"),
            *("-subj", "/CN=DeepLight", "-addext", f"subjectAltName={','.join(names)}"),
        ]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode:
            got = f"openssl failing: {' '.join(made.stderr.split())[-200:]}"
            raise ConfigError("a certificate", got, f"update it, or run: {_TUNNEL}")
        return context_of(certificate, key)


def context_of(certificate: Path, key: Path) -> tuple[ssl.SSLContext, str]:
    """TLS with somebody's certificate and key, PEM files; and the certificate's SHA-256.

    Raises:
        ConfigError: they cannot be used, or do not fit each other.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
        first = certificate.read_text().partition("-----BEGIN CERTIFICATE-----")[1:]
        end = "-----END CERTIFICATE-----"
        content = ssl.PEM_cert_to_DER_cert("".join(first).partition(end)[0] + end)
    except (OSError, ValueError) as error:
        got = f"{certificate} and {key} ({error})"
        raise ConfigError(
            "a certificate and its key (PEM)", got, "correct --certificate"
        ) from error
    digest = hashlib.sha256(content).hexdigest()
    return context, ":".join(digest[i : i + 2] for i in range(0, len(digest), 2)).upper()
