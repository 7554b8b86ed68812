"""Whether somebody listens at an address."""

from __future__ import annotations

import socket

from cell.verbs.doctor.finding import Finding

CHECK_LINE = "check power, cable, address and firewall"
_TIMEOUT_S = 2.0


def port(name: str, host: str, number: int) -> Finding:
    """Open a TCP connection and close it again."""
    name = f"{name} {host}:{number}"
    try:
        with socket.create_connection((host, number), _TIMEOUT_S):
            return Finding(name, True, "answers")
    except OSError as silent:
        return Finding(name, False, f"does not answer ({silent})", CHECK_LINE)


def host_port(address: str, standard: int) -> tuple[str, int]:
    """`host:port` taken apart."""
    host, _, given = address.partition(":")
    return host, int(given) if given.isdecimal() else standard
