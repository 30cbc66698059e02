"""Put before an attack: tries things, and tells at the first step what was got."""

TRIED, GOT = [], []


def attempt(name, action, *arguments):
    """Notes what an action returned, or that it raised."""
    try:
        result = action(*arguments)
    except BaseException as error:
        TRIED.append(f"{name}: {type(error).__name__}")
    else:
        TRIED.append(name)
        GOT.append(f"{name} -> {result!r:.300}")


def policy(obs):
    raise ValueError(f"tried {len(TRIED)}, got {'; '.join(GOT) or 'nothing'}")
