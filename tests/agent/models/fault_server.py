"""A loopback server that speaks both vendors' formats, and fails as it is told."""

import json
import socket
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

ANTHROPIC, OPENAI = "anthropic", "openai"
VENDORS = (ANTHROPIC, OPENAI)
PATHS = {ANTHROPIC: "/v1/messages", OPENAI: "/v1/chat/completions"}
MODEL = "served-model"


@dataclass(frozen=True)
class Seen:
    """A request as it came."""

    path: str
    headers: dict[str, str]
    body: dict


@dataclass
class FaultServer:
    """Answers each request with the next of its script, the last one for ever."""

    script: list[Callable] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=list)

    def __enter__(self):
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self):
                body = json.loads(self.rfile.read(int(self.headers["content-length"])))
                headers = {name.lower(): text for name, text in self.headers.items()}
                seen = Seen(self.path, headers, body)
                server.seen.append(seen)
                script = server.script
                play = script.pop(0) if len(script) > 1 else script[0]
                self.close_connection = True
                play(Line(self, server.closing, seen))

            do_GET = do_POST

            def log_message(self, *words):
                pass

        self.closing = threading.Event()
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        # Its threads end when the tests let go of their connections, or with it.
        self._http.daemon_threads = False
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.01,))
        self._thread.start()
        return self

    def __exit__(self, *error):
        self.closing.set()
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    def url(self, vendor):
        base = f"http://127.0.0.1:{self._http.server_port}"
        return base if vendor == ANTHROPIC else f"{base}/v1"


@dataclass
class Line:
    """The line to one client."""

    handler: BaseHTTPRequestHandler
    closing: threading.Event
    seen: Seen

    def start(self, status=200, content="text/event-stream", **headers):
        self.handler.send_response(status)
        self.handler.send_header("content-type", content)
        for name, value in headers.items():
            self.handler.send_header(name.replace("_", "-"), value)
        self.handler.end_headers()

    def send(self, text):
        self.handler.wfile.write(text.encode())
        self.handler.wfile.flush()

    def reset(self):
        """Ends the connection as a crashed machine does."""
        linger = struct.pack("ii", 1, 0)
        self.handler.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.handler.connection.close()

    def stall(self):
        """Says nothing more, until the client or the server goes away."""
        line = self.handler.connection
        line.settimeout(0.02)
        while not self.closing.is_set():
            try:
                if line.recv(1) == b"":
                    return
            except TimeoutError:
                continue
            except OSError:
                return


def events(vendor, text="Hello", stop=None, usage=True, counts=(30, 5)):
    """The stream of a whole answer, as a list of events; the last ones end it."""
    if vendor == ANTHROPIC:
        return _anthropic_events(text, stop, usage)
    return _openai_events(text, stop, usage, *counts)


def _event(kind, **facts):
    return f"event: {kind}\ndata: {json.dumps({'type': kind, **facts})}\n\n"


def _anthropic_events(text, stop, usage):
    counts = {"input_tokens": 7, "output_tokens": 1}
    counts |= {"cache_read_input_tokens": 20, "cache_creation_input_tokens": 3}
    message = {
        "id": "msg_1",
        "type": "message",
        "role": "assistant",
        "model": MODEL,
        "content": [],
        "stop_reason": None,
        "usage": counts if usage else {"input_tokens": 0, "output_tokens": 0},
    }
    block = {"type": "text", "text": ""}
    pieces = [text[at : at + 2] for at in range(0, len(text), 2)]
    shown = []
    if text:
        shown.append(_event("content_block_start", index=0, content_block=block))
        for piece in pieces:
            delta = {"type": "text_delta", "text": piece}
            shown.append(_event("content_block_delta", index=0, delta=delta))
        shown.append(_event("content_block_stop", index=0))
    delta = {"stop_reason": stop or "end_turn", "stop_sequence": None}
    return [
        _event("message_start", message=message),
        _event("ping"),
        *shown,
        _event("message_delta", delta=delta, usage={"output_tokens": 5}),
        _event("message_stop"),
    ]


def _openai_events(text, stop, usage, tokens_in, tokens_out):
    def chunk(choices, **facts):
        body = {"id": "c1", "object": "chat.completion.chunk", "created": 1}
        body |= {"model": MODEL, "choices": choices, **facts}
        return f"data: {json.dumps(body)}\n\n"

    def choice(delta, finish=None):
        return [{"index": 0, "delta": delta, "finish_reason": finish}]

    counts = {"prompt_tokens": tokens_in, "completion_tokens": tokens_out}
    counts["total_tokens"] = tokens_in + tokens_out
    counts |= {"prompt_tokens_details": {"cached_tokens": 20}}
    pieces = [text[at : at + 2] for at in range(0, len(text), 2)]
    return [
        chunk(choice({"role": "assistant", "content": ""})),
        *(chunk(choice({"content": piece})) for piece in pieces),
        chunk(choice({}, stop or "stop")),
        *([chunk([], usage=counts)] if usage else []),
        "data: [DONE]\n\n",
    ]


def answers(vendor, text="Hello", stop=None, **facts):
    """Plays a whole answer."""

    def play(line):
        line.start(request_id="req_7", x_request_id="req_7")
        line.send("".join(events(vendor, text, stop, **facts)))

    return play


def fails(vendor, status, kind="api_error", message="no", **headers):
    """Plays an error, as the vendor words it."""
    error = {"type": kind, "message": message, "code": None}
    body = {"error": error}
    if vendor == ANTHROPIC:
        body = {"type": "error", "error": error, "request_id": "req_7"}

    def play(line):
        text = json.dumps(body)
        line.start(
            status,
            "application/json",
            content_length=str(len(text)),
            request_id="req_7",
            x_request_id="req_7",
            **headers,
        )
        line.send(text)

    return play


def begins(vendor, then, text="Hello", pieces=4):
    """Plays the first events of an answer, and then something else."""

    def play(line):
        line.start()
        line.send("".join(events(vendor, text)[:pieces]))
        then(line)

    return play


def error_event(vendor, kind="overloaded_error"):
    """What is sent in the middle of a stream when something breaks."""
    error = {"type": kind, "message": "Overloaded", "code": kind}
    if vendor == ANTHROPIC:
        return (
            f"event: error\ndata: {json.dumps({'type': 'error', 'error': error})}\n\n"
        )
    return f"data: {json.dumps({'error': error})}\n\n"


def raw(text, content="text/event-stream", status=200):
    """Plays any body."""

    def play(line):
        line.start(status, content, content_length=str(len(text.encode())))
        line.send(text)

    return play
