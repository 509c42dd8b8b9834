"""A client of the service, as small as its interface: `Client`, and `AsyncClient` for programs of asyncio.

    with Client("http://127.0.0.1:8000") as client, client.open(sample="cornell") as session:
        session.edit(move("tall_block", translation=[0, 0.1, 0]))
        radiance = session.frame(wait="converged", format="npy").array

Each change is sent with a key of its own, so that it can be sent again where an answer was lost: what the
service has taken, it does not take twice.
"""

from halflight.client.answers import Edited, Frame, LogEntry, Picked, Probed, Status
from halflight.client.asynchronous import AsyncClient, AsyncSession
from halflight.client.asynchronous_streams import AsyncStream
from halflight.client.conversation import StreamFrame, StreamLostError
from halflight.client.edits import add, move, remove, set_material, set_mesh
from halflight.client.errors import ProblemError
from halflight.client.streams import Stream
from halflight.client.synchronous import Client, Session

__all__ = [
    "AsyncClient",
    "AsyncSession",
    "AsyncStream",
    "Client",
    "Edited",
    "Frame",
    "LogEntry",
    "Picked",
    "Probed",
    "ProblemError",
    "Session",
    "Status",
    "Stream",
    "StreamFrame",
    "StreamLostError",
    "add",
    "move",
    "remove",
    "set_material",
    "set_mesh",
]
