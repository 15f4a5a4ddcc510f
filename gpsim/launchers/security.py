"""TLS between scheduler, workers and client: whoever has not the command's key is sent away.

A Dask scheduler runs what it is sent, as its owner. One that a command starts takes orders from that command alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from distributed import Security

from gpsim.errors import UsageError
from gpsim.private import write_own

LOOPBACK = "127.0.0.1"
"""The address that only this machine reaches."""


def own_keys() -> Security:
    """A key and a certificate for this command, in memory."""
    return Security.temporary()


@contextmanager
def cluster_keys(folder: Path) -> Iterator[Security]:
    """Keys as files, which workers on other machines read: those that Dask's own configuration names, if it does.

    Else new ones, in a folder below `folder` that this user alone can enter; they go with the block.
    """
    if _configured():
        yield Security(require_encryption=True)
        return
    made = own_keys()
    with TemporaryDirectory(prefix=".tls-", dir=folder.absolute(), ignore_cleanup_errors=True) as place:
        certificate, key = Path(place, "certificate.pem"), Path(place, "key.pem")
        write_own(certificate, made.tls_ca_file.encode())
        write_own(key, made.tls_client_key.encode())
        files = {"ca_file": certificate}
        for role in ("client", "scheduler", "worker"):
            files |= {f"{role}_cert": certificate, f"{role}_key": key}
        yield Security(require_encryption=True, **{f"tls_{name}": str(path) for name, path in files.items()})


def check_keys(address: str) -> None:
    """Raise UsageError where a scheduler asks for a certificate and Dask's configuration names none."""
    if address.startswith("tls://") and not _configured():
        raise UsageError(
            f"launcher.address={address}: a tls:// scheduler wants a certificate: name it in Dask's configuration, as "
            "distributed.comm.tls.ca-file, .client.cert and .client.key"
        )


def _configured() -> bool:
    known = Security()
    return bool(known.tls_ca_file and known.tls_client_cert)
