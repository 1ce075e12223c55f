"""Finds the robot descriptions that installed packages ship."""

import importlib.metadata
import re
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
# `random_urdfs` has a thousand objects of one kind, of which one in this many is taken.
ONE_IN = 50
ROOT_TAG = re.compile(rb"<\s*([A-Za-z_][\w.:-]*)[\s/>]")
INCLUDED = re.compile(rb"<include\b[^>]*\bfile\s*=\s*[\"']([^\"']+)[\"']")


@dataclass(frozen=True)
class Description:
    """A file of a package: `kind` is urdf, mjcf or sdf; `is_included` means that another MJCF of the package includes it."""

    package: str
    path: Path
    kind: str
    is_included: bool

    @property
    def name(self):
        """The last parts of the path, to tell files of one package apart."""
        return "/".join(self.path.parts[-3:])


def versions():
    """The pinned versions by package, in the order of requirements.txt."""
    return dict(line.split("==") for line in (HERE / "requirements.txt").read_text().splitlines() if "==" in line)


def root_tag(text):
    """The tag of the root element, without comments and declarations before it."""
    plain = re.sub(rb"<!--.*?-->|<\?.*?\?>|<![A-Z].*?>", b"", text, flags=re.S)
    found = ROOT_TAG.search(plain)
    return found[1].decode() if found else ""


def kind_of(path):
    """The format of a file, or none if it is not a description for itself."""
    suffix = path.suffix.lower()
    if suffix in (".urdf", ".sdf"):
        return suffix[1:]
    # Parts that are only for others to include have another root, or no bodies and no parts.
    text = path.read_bytes()
    if suffix not in (".xml", ".mjcf") or root_tag(text) != "mujoco":
        return None
    return "mjcf" if b"<worldbody" in text or b"<include" in text else None


def is_taken(path, count):
    """Whether a file is in the corpus; `count` numbers the files of large sets."""
    if "random_urdfs" not in path.parts:
        return True
    count["random_urdfs"] = count.get("random_urdfs", -1) + 1
    return count["random_urdfs"] % ONE_IN == 0


def included_files(paths):
    """Files that an MJCF of the list includes. Names are relative to the main file, which may be in another folder."""
    names = set()
    for path in paths:
        for name in INCLUDED.findall(path.read_bytes()):
            names.add(Path(name.decode()).name)
    return {path for path in paths if path.name in names}


def find_descriptions(package):
    """The descriptions of an installed package, sorted by path; none if it is not installed."""
    try:
        files = importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    wanted = (".urdf", ".sdf", ".xml", ".mjcf")
    paths = sorted({Path(f.locate()).resolve() for f in files if f.suffix.lower() in wanted})
    paths = [path for path in paths if path.is_file()]
    inner, count = included_files([path for path in paths if path.suffix.lower() in (".xml", ".mjcf")]), {}
    kinds = [(path, kind_of(path)) for path in paths]
    return [Description(package, path, kind, path in inner) for path, kind in kinds if kind and is_taken(path, count)]
