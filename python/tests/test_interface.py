"""Promises of the package: documentation, types, size and speed."""

import inspect
import re
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest
from test_value import plain_value

import sidestep
from sidestep import exports, plots

SOURCES = Path(__file__).parent.parent


def test_the_stub_is_what_the_module_is(tmp_path):
    """Every name, argument and default of the native half, by mypy's own comparison; and the Python half by mypy."""
    settings = str(SOURCES / "pyproject.toml")
    compare = ["mypy.stubtest", "--concise", "--mypy-config-file", settings, "sidestep._sidestep"]
    check = ["mypy", "--config-file", settings, "-p", "sidestep"]
    for command in (compare, check):
        whole = [sys.executable, "-m", *command]
        said = subprocess.run(whole, capture_output=True, text=True, cwd=tmp_path)
        assert said.returncode == 0, said.stdout + said.stderr


def public():
    for module in (sidestep, exports, plots):
        for name in module.__all__:
            member = getattr(module, name)
            if callable(member):
                yield f"{module.__name__}.{name}", member
                if inspect.isclass(member):
                    for inner in vars(member):
                        # Fields of tuples are described with their class.
                        if not inner.startswith("_") and inner not in getattr(member, "_fields", ()):
                            yield f"{module.__name__}.{name}.{inner}", getattr(member, inner)


def test_everything_public_is_documented():
    for name, member in public():
        text = inspect.getdoc(member)
        assert text and text[0].isupper() and text.split("\n\n")[0].endswith("."), f"{name}: {text!r}"
        # Methods of scikit-learn are documented there.
        ours = not name.startswith("sidestep.SidestepClassifier.")
        if ours and callable(member) and not inspect.isclass(member):
            arguments = set(inspect.signature(member).parameters) - {"self", "path", "text"}
            described = set(re.findall(r"\w+", text.partition("Parameters\n")[2].partition("\nReturns\n")[0]))
            assert arguments <= described, f"{name} does not describe {arguments - described}"


def test_the_version_is_that_of_the_workspace():
    workspace = (SOURCES.parent / "Cargo.toml").read_text(encoding="utf-8")
    assert f'version = "{sidestep.__version__}"' in workspace


def test_nothing_heavy_is_imported():
    code = "import sys, sidestep; print(sorted({'matplotlib', 'pandas', 'polars', 'scipy', 'sklearn'} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_the_native_half_is_small():
    """Compressed, as in a wheel, which contains little else."""
    native = Path(sidestep._sidestep.__file__)
    assert len(zlib.compress(native.read_bytes())) < 3e6


@pytest.mark.filterwarnings("ignore::sidestep.AngleWarning")
def test_a_value_is_faster_than_the_formula_in_numpy(paper, rng):
    """Both in one run, so that the load of the machine does not matter."""
    states = rng.uniform(-20, 20, (200_000, 3))

    def least(work):
        took = []
        for _ in range(5):
            start = time.perf_counter()
            work()
            took.append(time.perf_counter() - start)
        return min(took)

    ours = least(lambda: sidestep.value(states, paper, threads=1))
    assert ours < least(lambda: plain_value(states, 2.0, 0.5, 3.0))
