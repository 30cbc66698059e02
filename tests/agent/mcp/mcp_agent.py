"""A scripted agent: the SDK's own client, which calls tools by name."""

from __future__ import annotations

import base64
import json
import os
import signal
import subprocess
import sys
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import anyio
import httpx2
from mcp import Client, StdioServerParameters, stdio_client
from mcp.client.streamable_http import streamable_http_client
from mcp_types import Implementation

NAME = Implementation(name="scripted", version="7")
TOKEN = "a-token-of-these-tests"


@dataclass
class Agent:
    """Calls the tools of a server."""

    client: Client
    steps: list[tuple] = field(default_factory=list)

    async def call(self, tool, **arguments):
        """The result of a tool."""

        async def progress(done, total, message):
            self.steps.append((done, total, message))

        return await self.client.call_tool(tool, arguments, progress_callback=progress)

    async def told(self, tool, **arguments):
        """The text of a result without an error."""
        result = await self.call(tool, **arguments)
        text = result.content[-1].text
        assert not result.is_error, text
        return text

    async def error(self, tool, **arguments):
        """The text of an error, which is one line."""
        result = await self.call(tool, **arguments)
        (content,) = result.content
        assert result.is_error, content.text
        assert "\n" not in content.text
        assert "Traceback" not in content.text
        return content.text

    async def submit(self, source):
        """The structured result; the text must agree with it."""
        return await self._verdict("submit", source=source)

    async def choose(self, number):
        """The structured result; the text must agree with it."""
        return await self._verdict("choose", submission=number)

    async def _verdict(self, tool, **arguments):
        result = await self.call(tool, **arguments)
        (content,) = result.content
        assert not result.is_error, content.text
        answer = result.structured_content
        word = content.text.partition(" ")[0].strip(":.")
        assert word == ("verified" if answer["verified"] else "failed")
        return answer

    async def picture(self, number, episode):
        """The bytes of a picture."""
        result = await self.call("picture", submission=number, episode=episode)
        assert not result.is_error, result.content[-1].text
        assert result.content[0].mime_type == "image/png"
        return base64.b64decode(result.content[0].data)


def converse(server, conversation, mode="auto"):
    """Connects an agent to a server and returns what the conversation returns."""

    async def whole():
        client = Client(server, client_info=NAME, mode=mode, read_timeout_seconds=300)
        async with client as connected:
            return await conversation(Agent(connected))

    return anyio.run(whole)


def words(*arguments):
    """The command line of a server."""
    return [sys.executable, "-m", "tdac_agent", "mcp", *map(str, arguments)]


def over_stdio(place, *arguments):
    """A server that the client starts itself."""
    command, *rest = words(*arguments)
    return stdio_client(
        StdioServerParameters(
            command=command, args=rest, cwd=place, env=dict(os.environ)
        )
    )


@asynccontextmanager
async def over_http(address, token=TOKEN):
    """A server that is running."""
    headers = {"Authorization": f"Bearer {token}"}
    async with (
        httpx2.AsyncClient(headers=headers, timeout=300) as client,
        streamable_http_client(address, http_client=client) as streams,
    ):
        yield streams


@dataclass
class Running:
    """A server over HTTP in a process of its own."""

    place: Path
    arguments: tuple
    token: str | None = TOKEN
    process: subprocess.Popen = field(init=False)
    address: str = field(init=False)

    def start(self):
        environment = dict(os.environ)
        if self.token is not None:
            environment["TDAC_MCP_TOKEN"] = self.token
        self.process = subprocess.Popen(
            words(*self.arguments, "--http"),
            cwd=self.place,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        self.address = self.process.stdout.readline().strip()
        assert self.address.startswith("http://127.0.0.1:"), self.process.stderr.read()
        return self

    def end(self, number=signal.SIGTERM):
        """Ends it; returns exit code and stderr."""
        self.process.send_signal(number)
        _, text = self.process.communicate(timeout=60)
        return self.process.returncode, text


def record(folder):
    """The record of a run."""
    return json.loads((folder / "run.json").read_text())
