"""Throw-away certificates for tests, made by openssl: an authority, and what it has signed."""

import subprocess
from pathlib import Path

KEY = ("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


def authority(folder: Path, name: str) -> None:
    """Make an authority: NAME.pem and NAME.key in a folder."""
    openssl(
        folder, *KEY, "-x509", "-days", "2", "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem"
    )


def certificate(folder: Path, name: str, signer: str, alternatives: str = "") -> tuple[str, str, str]:
    """Make a certificate that an authority has signed; return the files of the authority's, its own, and its key."""
    openssl(folder, *KEY, "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.csr")
    (folder / f"{name}.ext").write_text(f"subjectAltName={alternatives or f'DNS:{name}'}\n", encoding="utf-8")
    signed = ("x509", "-req", "-CA", f"{signer}.pem", "-CAkey", f"{signer}.key", "-CAcreateserial", "-days", "2")
    openssl(folder, *signed, "-extfile", f"{name}.ext", "-in", f"{name}.csr", "-out", f"{name}.pem")
    found = [str(folder / file) for file in (f"{signer}.pem", f"{name}.pem", f"{name}.key")]
    return found[0], found[1], found[2]


def openssl(folder: Path, *words: str) -> None:
    """Run openssl in a folder."""
    subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)
