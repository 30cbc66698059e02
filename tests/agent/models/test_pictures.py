"""Pictures that go with a question: as vendors, programs and people get them."""

import base64
import io
import re
import sys
import threading
from dataclasses import replace

import pytest
from fault_server import ANTHROPIC, OPENAI, VENDORS, answers
from PIL import Image

from tdac_agent.models.anthropic_api import AnthropicModel
from tdac_agent.models.choice import Options, choose_model
from tdac_agent.models.manual import Manual
from tdac_agent.models.openai_api import OpenAIModel
from tdac_agent.models.picture import LARGEST_SIDE, MOST_BYTES, Picture
from tdac_agent.models.prices import Price
from tdac_agent.models.provider import Reply, Request
from tdac_agent.models.tariff import Tariff, tariffs_of

STABLE, REST = "The rules of the game.\n", "It failed: see `edit.picture.png`.\n"


def png(width, height, colour=(200, 30, 40)):
    stream = io.BytesIO()
    Image.new("RGB", (width, height), colour).save(stream, "PNG")
    return stream.getvalue()


@pytest.fixture
def question(tmp_path):
    """A question with a picture that is on record."""
    content = png(1024, 768)
    file = tmp_path / "run" / "edit.picture.png"
    file.parent.mkdir()
    file.write_bytes(content)
    picture = Picture(file, content, "nominal: collision")
    prompt = STABLE + REST
    return Request("edit", prompt, stable=len(STABLE), images=(picture,))


def opened(data):
    """The picture, decoded as whoever gets it decodes it."""
    with Image.open(io.BytesIO(base64.b64decode(data, validate=True))) as picture:
        assert picture.format == "PNG"
        assert max(picture.size) <= LARGEST_SIDE
        return picture.convert("RGB").getpixel((3, 3))


@pytest.mark.parametrize("vendor", VENDORS)
def test_a_vendor_gets_the_picture_after_what_it_may_cache(vendor, server, question):
    server.script = [answers(vendor, "Seen.")]
    kind = AnthropicModel if vendor == ANTHROPIC else OpenAIModel
    assert kind("m", server.url(vendor)).complete(question).text == "Seen."
    (message,) = server.seen[0].body["messages"]
    first, image, last = message["content"]
    assert (first["text"], last["text"]) == (STABLE, REST)
    if vendor == ANTHROPIC:
        assert first["cache_control"] == {"type": "ephemeral"}
        assert image["type"] == "image"
        source = image["source"]
        assert (source["type"], source["media_type"]) == ("base64", "image/png")
        assert opened(source["data"]) == (200, 30, 40)
    else:
        assert image["type"] == "image_url"
        assert image["image_url"]["detail"] == "high"
        head, _, data = image["image_url"]["url"].partition(",")
        assert head == "data:image/png;base64"
        assert opened(data) == (200, 30, 40)


@pytest.mark.parametrize("vendor", VENDORS)
def test_without_a_picture_a_vendor_gets_what_it_always_got(vendor, server, question):
    server.script = [answers(vendor)]
    kind = AnthropicModel if vendor == ANTHROPIC else OpenAIModel
    kind("m", server.url(vendor)).complete(replace(question, images=()))
    (message,) = server.seen[0].body["messages"]
    content = message["content"]
    if vendor == OPENAI:
        assert content == STABLE + REST
    else:
        assert [block["text"] for block in content] == [STABLE, REST]


def test_a_program_gets_the_path_of_the_picture(question, tmp_path, small_task):
    program = tmp_path / "model.py"
    program.write_text(
        "import re, sys\n"
        "path = re.search(r'`(/.*[.]picture[.]png)`', sys.stdin.read())[1]\n"
        "print(open(path, 'rb').read(8) == b'\\x89PNG\\r\\n\\x1a\\n', path)\n"
    )
    name = f"command:{sys.executable} '{program}'"
    model = choose_model(name, Options(small_task.setting))
    (picture,) = question.images
    assert model.complete(question).text == f"True {picture.file}\n"


def test_a_person_finds_the_picture_beside_the_question(question, tmp_path):
    """A second life finds the answer to the same picture, not to another one."""
    folder = tmp_path / "mail"
    folder.mkdir()
    for number, text in enumerate(("one", "two", "three"), 1):
        (folder / f"{number:03}.reply.md").write_text(text)
    other = replace(question.images[0], png=png(10, 10, (0, 0, 0)))
    questions = [
        question,
        replace(question, images=(other,)),
        replace(question, repeat=1),
    ]
    for _ in range(2):
        model = Manual(folder, poll=0.001)
        texts = [model.complete(each).text for each in questions]
        assert texts == ["one", "two", "three"]
    for number, each in enumerate(questions, 1):
        prompt = (folder / f"{number:03}.prompt.md").read_text()
        (name,) = re.findall(r"`(.*)`", prompt)
        assert name == f"{number:03}.picture.png"
        assert (folder / name).read_bytes() == each.images[0].png
    assert len(list(folder.iterdir())) == 9


def test_the_picture_is_there_before_the_question(question, tmp_path):
    """Whoever finds a question finds its picture, too."""
    folder = tmp_path / "mail"
    folder.mkdir()
    found = []

    def answer():
        path = folder / "001.prompt.md"
        while not path.exists() and not given_up.wait(0.001):
            pass
        found.append((folder / "001.picture.png").exists())
        (folder / "001.reply.md").write_text("seen")

    given_up = threading.Event()
    thread = threading.Thread(target=answer)
    thread.start()
    assert Manual(folder, poll=0.001).complete(question) == Reply("seen")
    given_up.set()
    thread.join()
    assert found == [True]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (png(LARGEST_SIDE + 1, 10), "at most 1024 x 1024 px, got 1025 x 10"),
        (png(10, 10) + bytes(MOST_BYTES), f"at most {MOST_BYTES} bytes"),
        (b"GIF89a", "expected a PNG file"),
    ],
)
def test_a_picture_has_bounds(content, reason, tmp_path):
    with pytest.raises(ValueError, match=reason):
        Picture(tmp_path / "edit.picture.png", content, "")


@pytest.mark.parametrize(
    ("name", "least"),
    # As the vendors count 1024 x 1024 px in the models that take most tokens.
    [("anthropic:m", 37 * 37), ("openai:m", 2833 + 4 * 5667), ("mine:m", 25_501)],
)
def test_a_reservation_counts_the_picture(name, least, question, monkeypatch):
    monkeypatch.delenv("TDAC_PRICES", raising=False)

    class Model:
        paid = True

    model = Model()
    model.name = name
    tariff = tariffs_of([model])[name]
    blind = tariff.worst(replace(question, images=()))
    assert tariff.worst(question).tokens - blind.tokens >= least
    price = Price(input=2, output=10)
    priced = Tariff(price=price, picture_tokens=tariff.picture_tokens)
    more = priced.worst(question).usd - priced.worst(replace(question, images=())).usd
    assert more == pytest.approx(2e-6 * tariff.picture_tokens)
    assert Tariff(free=True).worst(question).tokens == 0
