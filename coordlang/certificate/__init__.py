# SPDX-License-Identifier: GPL-3.0-or-later
"""Why fewer words do not suffice: a certificate that a third party can check."""

from coordlang.certificate.check import Checked, check
from coordlang.certificate.encoding import Cnf, encode
from coordlang.certificate.file import Certificate, Reason, read_certificate, write_certificate
from coordlang.certificate.make import certify

__all__ = [
    "Certificate",
    "Checked",
    "Cnf",
    "Reason",
    "certify",
    "check",
    "encode",
    "read_certificate",
    "write_certificate",
]
