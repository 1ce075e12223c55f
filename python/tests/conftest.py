"""What tests share: bundled models and recordings, and the program beside which the package is held."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(os.environ.get("MODELMILL_ROOT", Path(__file__).resolve().parents[2]))
MODELS = ROOT / "model-spec" / "models"
RECORDINGS = ROOT / "recordings"


@pytest.fixture(autouse=True)
def _at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both the package and the program are given paths from the root, so that names in their answers are alike."""
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="session")
def program() -> Callable[..., Any]:
    """Runs the program and reads its JSON, if it prints any."""
    given = os.environ.get("MODELMILL_PROGRAM")
    path = Path(given) if given else ROOT / "target" / "debug" / "modelmill"
    if not path.is_file():
        pytest.skip(f"{path} is not built: cargo build -p modelmill-cli")

    def run(*arguments: str) -> Any:
        done = subprocess.run([path, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout) if done.stdout else None

    return run
