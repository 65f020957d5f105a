# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Certificates of the tests."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID


def make_certificate(folder: Path, name: str, uri: str) -> None:
    """Write NAME.der, NAME.crt and NAME.pem: a certificate that signs itself, and its key."""
    key = rsa.generate_private_key(65537, 2048)
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.now(UTC)
    names = [x509.UniformResourceIdentifier(uri), x509.DNSName('localhost')]
    usage = dict.fromkeys(
        ('content_commitment', 'key_encipherment', 'data_encipherment', 'digital_signature'), True
    ) | dict.fromkeys(('key_agreement', 'key_cert_sign', 'crl_sign', 'encipher_only'), False)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName(names), False)
        .add_extension(x509.KeyUsage(decipher_only=False, **usage), False)
        .add_extension(
            x509.ExtendedKeyUsage(
                [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
            ),
            False,
        )
        .sign(key, hashes.SHA256())
    )
    (folder / f'{name}.der').write_bytes(certificate.public_bytes(serialization.Encoding.DER))
    (folder / f'{name}.crt').write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    (folder / f'{name}.pem').write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
