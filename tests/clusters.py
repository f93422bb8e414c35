"""A cluster of dask's on this machine, as people start one: `dask scheduler`, `dask worker`, over TLS."""

import json
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest

PATIENCE = 120.0
"""s, for a process to begin on a busy machine."""


def _free_port() -> int:
    """None of those that the system gives who connects: a worker that looks for a lost scheduler could meet itself."""
    while True:
        port = random.randrange(10_000, 30_000)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Identity(NamedTuple):
    """Who is let in."""

    ca: Path
    cert: Path
    key: Path


def identity(folder: Path, name: str) -> Identity:
    """A certificate, signed by itself, and its key."""
    openssl = shutil.which("openssl")
    if not openssl:
        pytest.skip("no openssl: apt-get install openssl")
    cert, key = folder / f"{name}.pem", folder / f"{name}.key"
    command = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
               "-subj", f"/CN={name}", "-keyout", str(key), "-out", str(cert)]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    return Identity(cert, cert, key)


class Cluster:
    """A scheduler and workers, each a process with one thread."""

    def __init__(self, folder: Path, identity: Identity, environment: Mapping[str, str]) -> None:
        self.tls = identity
        self.workers: list[subprocess.Popen[bytes]] = []
        self._folder, self._environment, self._port = folder, {**os.environ, **environment}, _free_port()
        self.start_scheduler()

    def start_scheduler(self) -> None:
        """Where it was, if it is started again."""
        there = self._folder / "scheduler.json"
        there.unlink(missing_ok=True)
        own = ("--scheduler-file", str(there), "--protocol", "tls", "--port", str(self._port))
        alone = ("--dashboard-address", "127.0.0.1:0", "--idle-timeout", "10 minutes")  # a test may be killed
        self.scheduler = self._started("scheduler", *own, *alone)
        deadline = time.monotonic() + PATIENCE
        while not (there.exists() and (content := there.read_text())):
            assert self.scheduler.poll() is None, self.said()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        self.address: str = json.loads(content)["address"]

    def start_workers(self, count: int) -> None:
        """They are waited for where they are needed."""
        own = ("--nthreads", "1", "--no-nanny", "--local-directory", str(self._folder), "--death-timeout", "2 minutes")
        self.workers += [self._started("worker", self.address, *own) for _ in range(count)]

    def _started(self, what: str, *arguments: str) -> subprocess.Popen[bytes]:
        files = ("--tls-ca-file", self.tls.ca, "--tls-cert", self.tls.cert, "--tls-key", self.tls.key)
        command = [
            sys.executable,
            "-m",
            "dask",
            what,
            *arguments,
            "--host",
            "127.0.0.1",
            "--no-dashboard",
            *map(str, files),
        ]
        with (self._folder / "said.txt").open("ab") as said:
            return subprocess.Popen(command, stdout=said, stderr=said, env=self._environment, cwd=self._folder)

    def said(self) -> str:
        """What its processes wrote."""
        return (self._folder / "said.txt").read_text()

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """As the machine that it is on would end."""
        process.kill()
        process.wait()
        self.workers = [each for each in self.workers if each is not process]

    def close(self) -> None:
        """All of it."""
        for process in (*self.workers, self.scheduler):
            self.kill(process)


@contextmanager
def cluster(folder: Path, count: int, environment: Mapping[str, str]) -> Iterator[Cluster]:
    """With so many workers, while it is needed."""
    made = Cluster(folder, identity(folder, "ours"), environment)
    try:
        made.start_workers(count)
        yield made
    finally:
        made.close()
