"""Every simulated device listens on an address of its own, however many there have been."""

from __future__ import annotations

import ipaddress
import os

import pytest

from sim.peers.loopback import own_address


@pytest.mark.parametrize("process", [1, 8191, 8192 * 3 - 1, 4_194_303])
def test_a_thousand_addresses_of_a_process_are_valid_and_different(
    process: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "getpid", lambda: process)
    addresses = {ipaddress.ip_address(own_address()) for _ in range(1000)}
    assert len(addresses) == 1000
    assert all(address.is_loopback and str(address) >= "127.1" for address in addresses)


def test_neighbouring_processes_share_no_address(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[set[str]] = []
    for process in (700, 701):
        monkeypatch.setattr(os, "getpid", lambda process=process: process)
        drawn.append({own_address() for _ in range(1024)})
    assert not drawn[0] & drawn[1]
