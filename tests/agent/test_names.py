"""The public names of both packages."""

import pytest

import tdac_agent
import tdac_envs

PACKAGES = (tdac_agent, tdac_envs)


@pytest.mark.parametrize("package", PACKAGES)
def test_tab_completion_knows_every_name(package):
    """Those that are imported on first use as well."""
    names = dir(package)
    assert set(package.__all__) <= set(names)
    assert all(hasattr(package, name) for name in names)


@pytest.mark.parametrize("package", PACKAGES)
def test_any_other_name_is_refused(package):
    with pytest.raises(AttributeError, match="has no attribute 'verfy'"):
        package.verfy  # noqa: B018
