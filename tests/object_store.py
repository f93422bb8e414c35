"""An object store with the protocol of S3, over HTTP on this machine; it can be told to fail."""

import itertools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import WSGIRequestHandler, make_server

Refuse = Callable[[str, str], str | None]
"""Method and path of a request -> the status that it is answered with; None: it is served."""
SLOW_DOWN, FORBIDDEN = "503 Slow Down", "403 Forbidden"


class _Quiet(WSGIRequestHandler):
    def log(self, *_args: Any) -> None:
        """Nothing."""


class ObjectStore:
    """moto's server, which keeps everything in memory."""

    def __init__(self) -> None:
        self._served = DomainDispatcherApplication(create_backend_app)
        self.refuse: Refuse | None = None
        self.refused = 0
        """Requests that were."""
        self.server = make_server("127.0.0.1", 0, self._answer, threaded=True, request_handler=_Quiet)

    @property
    def environment(self) -> dict[str, str]:
        """What the library of S3 is to find."""
        return {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.server.port}",
            "AWS_ACCESS_KEY_ID": "anyone",
            "AWS_SECRET_ACCESS_KEY": "anything",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_MAX_ATTEMPTS": "1",  # the library's own, with their pauses of seconds, would hide what fails
        }

    def _answer(self, request: dict[str, Any], start: Callable[..., Any]) -> Any:
        status = self.refuse(request["REQUEST_METHOD"], request["PATH_INFO"]) if self.refuse else None
        if status is None:
            return self._served(request, start)
        self.refused += 1
        start(status, [("Content-Length", "0")])
        return [b""]


def every(nth: int) -> Refuse:
    """Every n-th write of a chunk fails, as where a store is asked for too much."""
    numbers, lock = itertools.count(1), threading.Lock()

    def refuse(method: str, path: str) -> str | None:
        if method != "PUT" or not path.endswith(".parquet"):
            return None
        with lock:
            return SLOW_DOWN if next(numbers) % nth == 0 else None

    return refuse


@contextmanager
def object_store() -> Iterator[ObjectStore]:
    """While it is served."""
    store = ObjectStore()
    thread = threading.Thread(target=store.server.serve_forever)
    thread.start()
    try:
        yield store
    finally:
        store.server.shutdown()
        thread.join()
        store.server.server_close()
