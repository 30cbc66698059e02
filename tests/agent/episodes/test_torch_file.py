"""Weights are read as torch would read them, or refused before they cost memory."""

import io
import pickle
import zipfile
from collections import OrderedDict

import pytest

from tdac_agent.episodes.torch_file import read_weights


def zipped(pickled, size=16, **more):
    """A torch file of a pickle, with one storage of some bytes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, part in {"data.pkl": pickled, "data/0": bytes(size), **more}.items():
            archive.writestr(f"archive/{name}", part)
    return content.getvalue()


class Pickler(pickle.Pickler):
    """Pickles a tensor's parts as torch does."""

    def persistent_id(self, value):
        return value.parts if isinstance(value, Storage) else None

    def reducer_override(self, value):
        return value.call if isinstance(value, Tensor) else NotImplemented


class Storage:
    """A storage as the pickle describes it."""

    def __init__(self, key="0", count=4):
        self.parts = ("storage", float, key, "cpu", count)


class Tensor:
    """A tensor as the pickle describes it."""

    def __init__(self, shape, strides, offset=0, **storage):
        # As in torch, no two tensors have one tuple.
        sizes = (*shape,), (*strides,)
        arguments = (Storage(**storage), offset, *sizes, False, OrderedDict())
        self.call = divmod, arguments


def described(size=16, /, **tensors):
    """A torch file with tensors of one storage."""
    content = io.BytesIO()
    Pickler(content, protocol=2).dump(tensors)
    # `divmod` and `float` stand for names of torch, which need not be installed.
    pickled = content.getvalue()
    pickled = pickled.replace(
        b"c__builtin__\ndivmod\n", b"ctorch._utils\n_rebuild_tensor_v2\n"
    )
    pickled = pickled.replace(b"c__builtin__\nfloat\n", b"ctorch\nFloatStorage\n")
    return zipped(pickled, size)


def test_what_torch_saves_is_read():
    """Names, shapes and numbers are those that torch loads, of each kind of number."""
    torch = pytest.importorskip("torch")
    content = io.BytesIO()
    layer = torch.nn.Linear(5, 3)
    held = layer.state_dict() | {
        str(kind): torch.rand(2, 3, 4).to(kind)
        for kind in (torch.float64, torch.float16, torch.bfloat16)
    }
    held["slice"] = torch.rand(4, 3)[1:3]
    held["column"] = torch.rand(4, 1)
    held["one"] = torch.tensor(1.5)
    torch.save(held, content)
    found = read_weights(content.getvalue())
    assert found.keys() == held.keys()
    for name, tensor in held.items():
        assert found[name].shape == tuple(tensor.shape)
        numbers = torch.frombuffer(bytearray(found[name].data), dtype=tensor.dtype)
        assert torch.equal(numbers.reshape(found[name].shape), tensor)


@pytest.mark.parametrize(
    ("algo", "options"), [("PPO", {}), ("SAC", {"buffer_size": 1})]
)
def test_what_stable_baselines3_saves_is_read(algo, options, tmp_path):
    """Each byte of each tensor is what torch loads from the same file."""
    torch = pytest.importorskip("torch")
    sb3 = pytest.importorskip("stable_baselines3")
    make = getattr(sb3, algo)
    model = make("MlpPolicy", "Pendulum-v1", device="cpu", **options)
    model.save(tmp_path / "model.zip")
    with zipfile.ZipFile(tmp_path / "model.zip") as archive:
        file = archive.read("policy.pth")
    loaded = torch.load(io.BytesIO(file), weights_only=True)
    found = read_weights(file)
    assert list(found) == list(loaded)
    for name, tensor in loaded.items():
        assert found[name].shape == tuple(tensor.shape)
        assert bytes(found[name].data) == tensor.numpy().tobytes()


@pytest.mark.parametrize(
    ("tensor", "match"),
    [
        (Tensor((4096, 4096), (0, 0)), "does not store each"),
        (Tensor((2, 2), (1, 2)), "does not store each"),
        (Tensor((2, 3), (3, 1)), "beyond its storage"),
        (Tensor((2,), (1,), 3), "beyond its storage"),
        (Tensor((2,), (1,), -1), "beyond its storage"),
        (Tensor((0,), (1,)), "or of none"),
        (Tensor((-2,), (1,)), "or of none"),
        (Tensor((1,) * 9, (1,) * 9), "9 dimensions"),
        (Tensor((2, 2), (2,)), "zip"),
        (Tensor((1.5,), (1,)), "BINFLOAT"),
        (Tensor((4,), (1,), count=5), "claims 20 bytes, and has 16"),
        (Tensor((4,), (1,), count=-4), "claims -16 bytes"),
        (Tensor((4,), (1,), key="1"), "data/1"),
    ],
)
def test_a_tensor_has_all_its_numbers(tensor, match):
    """It claims no more than its storage, and the storage no more than its bytes."""
    with pytest.raises(ValueError, match=match):
        read_weights(described(a=tensor))


def test_tensors_are_not_larger_than_their_file():
    """Nor are all of them together, if they share a storage."""
    many = {f"a{number}": Tensor((4000,), (1,), count=4000) for number in range(600)}
    assert read_weights(described(16_000, a=many["a0"]))["a"].shape == (4000,)
    with pytest.raises(ValueError, match="larger than the file"):
        read_weights(described(16_000, **many))


SHARED = b"K\x01" + b"".join(b"q%ch%c\x86" % (i, i) for i in range(59))
"""Pairs of pairs of pairs, with 2^59 numbers in the end."""
DICT = b"ccollections\nOrderedDict\n)R"
STATE = b"}(%b%bub" % tuple(
    b"X%c\0\0\0%bccollections\nOrderedDict\n" % (len(name), name)
    for name in (b"items", b"values")
)
"""Gives the dictionary before it methods that return an empty one."""


@pytest.mark.parametrize(
    ("pickled", "match"),
    [
        (b"\x80\x02cos\nsystem\n.", "holds more than weights: os system"),
        (b"\x80\x02\x8cxx.", "expected 120 bytes"),
        (b"\x80\x02]a.", "holds more than weights: EMPTY_LIST"),
        (b"\x80\x02}" + b"N0" * 40_000 + b".", "more than weights: POP"),
        (b"\x80\x02}" + b"q\0" * 40_000 + b".", "more than 30000"),
        (b"\x80\x02})" + b"\x85" * 29_000 + b"Ns.", "nests tuples"),
        (b"\x80\x02})Ns.", "not tensors by name"),
        (b"\x80\x02}(" + SHARED + b"K\x01u.", "uses again"),
        (b"\x80\x02}((X\x07\0\0\0storagectorch\nFloatStorage\n" + SHARED, "again"),
        (b"\x80\x02}q\0h\0.", "uses again"),
        (b"\x80\x02}q\0h\1.", "uses again"),
        (b"\x80\x02((X\x07\0\0\0storagectorch\nFloatStorage\n))K\x04tQ.", "a storage"),
        (b"\x80\x02X\0\0\0\0)R.", "an unknown call"),
        (b"\x80\x02" + DICT + b"X\x01\0\0\0aNs" + STATE + b".", "not tensors by name"),
        (b"\x80\x02N.", "expected tensors by name"),
        (b"\x80\x02}X\x01\0\0\0aNs.", "not tensors by name"),
    ],
    ids=range(16),
)
def test_a_pickle_only_describes_tensors(pickled, match):
    """Anything else is refused before it is read, at the cost of its bytes."""
    with pytest.raises(ValueError, match=match):
        read_weights(zipped(pickled))


def test_the_state_of_a_dictionary_is_dropped():
    """It cannot hide tensors from what checks them."""
    pickled = b"\x80\x02" + DICT + STATE + b"."
    assert read_weights(zipped(pickled)) == {}
    assert read_weights(zipped(b"\x80\x02}r\xff\xff\xff\x7f.")) == {}


def test_there_is_one_pickle():
    """With two, another reader might load the other one."""
    with pytest.raises(ValueError, match=r"one data\.pkl, got 2"):
        read_weights(zipped(b"\x80\x02}.", **{"more/data.pkl": b""}))
