#!/usr/bin/env python3
"""Generates large hostile files of each kind that the program reads, and measures time and memory of the command that reads
each of them.

    measure.py PROGRAM [--sizes 1,10] [--folder DIR] [--only TEXT]

A line per file: kind, size in MB, exit status, seconds per MB, largest resident memory relative to the file's size, and the
first line of the message. A file fails when it takes more than 2 s per MB, more memory than 10 times its size (and
64 MB for any file, since limits of counts hold from some size on), or ends by a signal. Kinds that need a package of
Python (h5py, pyarrow, mcap) are left out without it.
"""

import argparse
import gzip
import os
import pathlib
import sqlite3
import struct
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MODEL = ROOT / "model-spec/models/two_link.toml"
RIG = ROOT / "model-spec/rigs/spidermill-full.toml"
MAP = ["--map", "joint1=q1", "--map", "joint2=q2"]

# Limits: seconds per MB of the file, with one second for the start of the program and its model; memory as multiples of
# the file, in addition to that of the program.
MOST_SECONDS_PER_MB = 2.0
MOST_TIMES_THE_SIZE = 10.0
PROGRAM_MB = 64.0
START_SECONDS = 1.0


def filled(begin, part, end, size):
    """`begin`, then `part` (a text, or a function of its number) repeated up to the size, then `end`."""
    if isinstance(part, str):
        return begin + part * max(1, (size - len(begin) - len(end)) // len(part)) + end
    parts, n, k = [begin], len(begin) + len(end), 0
    while n < size:
        parts.append(part(k))
        n += len(parts[-1])
        k += 1
    parts.append(end)
    return "".join(parts)


def texts():
    """Files of text: name, ending, function of the size."""
    yield "csv-blank-lines", "csv", lambda n: filled("t,q1,q2\n", "\n", "", n)
    yield "csv-blank-lines-first", "csv", lambda n: filled("", "\n", "t,q1,q2\n0,1,2\n", n)
    yield "csv-carriage-returns", "csv", lambda n: filled("t,q1,q2\n", "\r", "", n)
    yield "csv-commas", "csv", lambda n: filled("", ",", "", n)
    yield "csv-one-field", "csv", lambda n: filled("", "a", "", n)
    yield "csv-one-quoted-field", "csv", lambda n: filled('t,q1,"', "a\n", "", n)
    yield "csv-quotes", "csv", lambda n: filled("t,q1,q2\n", '"', "", n)
    yield "csv-many-columns", "csv", lambda n: filled(",".join(f"c{k}" for k in range(60000)) + "\n", ",".join("0" * 60000) + "\n", "", n)
    yield "csv-many-columns-blank-rows", "csv", lambda n: filled(",".join(f"c{k}" for k in range(60000)) + "\n", "0\n", "", n)
    yield "csv-ragged", "csv", lambda n: filled("t,q1,q2\n", lambda k: "1," * (k % 50) + "\n", "", n)
    yield "csv-short-rows", "csv", lambda n: filled("t\n", "1\n", "", n)
    yield "csv-long-numbers", "csv", lambda n: filled("t,q1,q2\n", lambda k: f"{k}.{'1' * 900},0.{'0' * 900}1,1e-{'9' * 300}\n", "", n)
    yield "csv-words", "csv", lambda n: filled("t,q1,q2\n", "a,b,c\n", "", n)
    yield "csv-comments", "csv", lambda n: filled("", "# a\n", "t,q1,q2\n0,1,2\n", n)
    yield "csv-spaces", "csv", lambda n: filled("t,q1,q2\n", " ", "\n", n)
    yield "csv-nul", "csv", lambda n: filled("t,q1,q2\n", "\0", "\n", n)
    yield "csv-mixed-separators", "csv", lambda n: filled("t;q1\tq2\n", "1;2\t3,4|5\n", "", n)
    yield "csv-numbers", "csv", lambda n: filled("t,q1,q2,joint1,joint2\n", lambda k: f"{k * 0.001},{k % 7},{k % 5},{k % 3},1\n", "", n)
    yield "csv-same-names", "csv", lambda n: filled(",".join(["q1"] * 60000) + "\n", ",".join("0" * 60000) + "\n", "", n)
    robot = "<robot name='r'>\n<link name='a'/>\n"
    joint = "<joint name='j{k}' type='{kind}'><parent link='{p}'/><child link='l{k}'/><axis xyz='0 0 1'/></joint>\n<link name='l{k}'/>\n"
    chain = lambda kind: (lambda k: joint.format(k=k, kind=kind, p="a" if k == 0 else f"l{k - 1}"))
    star = lambda kind: (lambda k: joint.format(k=k, kind=kind, p="a"))
    for kind in ["fixed", "revolute"]:
        yield f"urdf-chain-{kind}", "urdf", lambda n, kind=kind: filled(robot, chain(kind), "</robot>", n)
        yield f"urdf-star-{kind}", "urdf", lambda n, kind=kind: filled(robot, star(kind), "</robot>", n)
    yield "urdf-attributes", "urdf", lambda n: filled("<robot name='r' ", lambda k: f"a{k}='1' ", "></robot>", n)
    yield "urdf-long-attribute", "urdf", lambda n: filled("<robot name='", "a", "'/>", n)
    yield "urdf-deep", "urdf", lambda n: filled("<robot name='r'>", "<link>", "", n)
    yield "urdf-text", "urdf", lambda n: filled("<robot name='r'>", "a\n", "</robot>", n)
    yield "urdf-empty-elements", "urdf", lambda n: filled("<robot name='r'>", "<a/>", "</robot>", n)
    yield "urdf-comments", "urdf", lambda n: filled("<robot name='r'>", "<!---->", "</robot>", n)
    yield "urdf-references", "urdf", lambda n: filled("<robot name='r'>", "&lt;", "</robot>", n)
    yield "urdf-numbers", "urdf", lambda n: filled("<robot name='r'><link name='a'><inertial><origin xyz='", "1 ", "'/></inertial></link></robot>", n)
    yield "urdf-links", "urdf", lambda n: filled("<robot name='r'>", lambda k: f"<link name='l{k}'/>", "</robot>", n)
    yield "urdf-doctype", "urdf", lambda n: filled("<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>", lambda k: f"<!ENTITY a{k} '&a;&a;&a;'>", "]><robot name='&a2;'/>", n)
    yield "urdf-processing", "urdf", lambda n: filled("", "<?a?>", "<robot name='r'/>", n)
    yield "urdf-newlines", "urdf", lambda n: filled("", "\n", "<robot name='r'/>", n)
    world = "<mujoco><worldbody>"
    yield "mjcf-deep", "xml", lambda n: filled(world, "<body>", "", n)
    yield "mjcf-bodies", "xml", lambda n: filled(world, "<body/>", "</worldbody></mujoco>", n)
    yield "mjcf-joints", "xml", lambda n: filled(world + "<body>", "<joint/>", "</body></worldbody></mujoco>", n)
    yield "mjcf-geoms", "xml", lambda n: filled(world + "<body>", "<geom size='1'/>", "</body></worldbody></mujoco>", n)
    yield "mjcf-classes", "xml", lambda n: filled("<mujoco><default>", lambda k: f"<default class='c{k}'/>", "</default><worldbody/></mujoco>", n)
    yield "mjcf-classes-used", "xml", lambda n: filled("<mujoco><default>" + "".join(f"<default class='c{k}'><geom size='1'/></default>" for k in range(2000)) + "</default><worldbody>", lambda k: f"<geom class='c{k % 2000}'/>", "</worldbody></mujoco>", n)
    yield "mjcf-actuators", "xml", lambda n: filled(world + "<body><joint name='j'/><geom size='1'/></body></worldbody><actuator>", "<motor joint='j'/>", "</actuator></mujoco>", n)
    yield "mjcf-equalities", "xml", lambda n: filled(world + "<body name='b'><joint name='j'/><geom size='1'/></body></worldbody><equality>", "<joint joint1='j'/>", "</equality></mujoco>", n)
    yield "mjcf-connects", "xml", lambda n: filled(world + "<body name='b'><joint name='j'/><geom size='1'/></body></worldbody><equality>", "<connect body1='b' anchor='1 0 0'/>", "</equality></mujoco>", n)
    yield "mjcf-tendons", "xml", lambda n: filled(world + "<body name='b'><joint name='j'/><geom size='1'/></body></worldbody><tendon>", lambda k: f"<fixed name='t{k}'><joint joint='j' coef='1'/></fixed>", "</tendon></mujoco>", n)
    yield "mjcf-sites", "xml", lambda n: filled(world + "<body name='b'><joint name='j'/><geom size='1'/>", lambda k: f"<site name='s{k}'/>", "</body></worldbody></mujoco>", n)
    mesh = "<mesh name='m{k}' inertia='shell' vertex='0 0 0 1 0 0 0 1 0' face='0 1 2'/>"
    yield "mjcf-meshes", "xml", lambda n: filled("<mujoco><asset>" + "".join(mesh.format(k=k) for k in range(max(1, n // 120))) + "</asset><worldbody><body>", lambda k: f"<geom type='mesh' mesh='m{k}'/>" if k < n // 120 else " " * 1000, "</body></worldbody></mujoco>", n)
    yield "mjcf-mesh-used", "xml", lambda n: filled("<mujoco><asset><mesh name='m' inertia='shell' vertex='0 0 0 1 0 0 0 1 0' face='" + "0 1 2 " * max(1, n // 12) + "'/></asset><worldbody><body>", "<geom type='mesh' mesh='m'/>", "</body></worldbody></mujoco>", n)
    yield "mjcf-options", "xml", lambda n: filled("<mujoco>", "<option/><compiler/>", "<worldbody/></mujoco>", n)
    sdf = "<sdf version='1.9'><model name='m'>"
    yield "sdf-deep-models", "sdf", lambda n: filled("<sdf version='1.9'>", "<model name='m'>", "", n)
    yield "sdf-links", "sdf", lambda n: filled(sdf, lambda k: f"<link name='l{k}'/>", "</model></sdf>", n)
    yield "sdf-frames", "sdf", lambda n: filled(sdf + "<link name='a'/>", lambda k: f"<frame name='f{k}' attached_to='{'a' if k == 0 else f'f{k - 1}'}'/>", "</model></sdf>", n)
    yield "sdf-joints", "sdf", lambda n: filled(sdf + "<link name='a'/>", lambda k: f"<link name='l{k}'/><joint name='j{k}' type='fixed'><parent>{'a' if k == 0 else f'l{k - 1}'}</parent><child>l{k}</child></joint>", "</model></sdf>", n)
    yield "sdf-models", "sdf", lambda n: filled("<sdf version='1.9'>", lambda k: f"<model name='m{k}'><link name='a'/></model>", "</sdf>", n)
    # Model files.
    head = "schema = 1\nname = \"m\"\n"
    yield "model-tables", "toml", lambda n: filled(head, lambda k: f"[a{k}]\n", "", n)
    yield "model-blank", "toml", lambda n: filled(head, "\n", "", n)
    yield "model-comments", "toml", lambda n: filled(head, "#a\n", "", n)
    yield "model-long-comment", "toml", lambda n: filled(head + "#", "a", "\n", n)
    yield "model-long-title", "toml", lambda n: filled(head + 'title = "', "a", '"\n', n)
    yield "model-long-key", "toml", lambda n: filled(head, "a", " = 1\n", n)
    yield "model-dotted-key", "toml", lambda n: filled(head, "a.", "a = 1\n", n)
    yield "model-nested-list", "toml", lambda n: filled(head + "a = ", "[", "", n)
    yield "model-nested-table", "toml", lambda n: filled(head + "a = ", "{a=", "", n)
    yield "model-list", "toml", lambda n: filled(head + "a = [", "1,", "]\n", n)
    yield "model-long-number", "toml", lambda n: filled(head + "gravity = [0, 0, ", "1", "]\n", n)
    yield "model-escapes", "toml", lambda n: filled(head + 'title = "', "\\u0041", '"\n', n)
    yield "model-long-text", "toml", lambda n: filled(head + 'title = """', "\\\n", '"""\n', n)
    yield "model-constants", "toml", lambda n: filled(head + "[constants]\n", lambda k: f"c{k}={{value=1.0,unit=\"m\"}}\n", "", n)
    yield "model-constants-chain", "toml", lambda n: filled(head + "[constants]\nc0={value=1.0,unit=\"m\"}\n", lambda k: f"c{k + 1}={{value=\"c{k} + c{k}\",unit=\"m\"}}\n", "", n)
    yield "model-parameters", "toml", lambda n: filled(head + "[parameters]\n", lambda k: f"p{k}={{nominal=1.0,unit=\"kg\"}}\n", "", n)
    yield "model-coordinates", "toml", lambda n: filled(head + "[coordinates]\n", lambda k: f"q{k}={{}}\n", "", n)
    yield "model-frames-chain", "toml", lambda n: filled(head, lambda k: f"[[frame]]\nname=\"f{k}\"\non=\"{'base' if k == 0 else f'f{k - 1}'}\"\ntranslate=[1,0,0]\n", "", n)
    yield "model-expression-sum", "toml", lambda n: filled(head + '[constants]\na = { value = 1.0, unit = "m" }\nb = { value = "', "a+", 'a", unit = "m" }\n', n)
    yield "model-expression-product", "toml", lambda n: filled(head + '[constants]\na = { value = 1.0, unit = "m" }\nb = { value = "', "a*", 'a", unit = "m" }\n', n)
    yield "model-expression-nested", "toml", lambda n: filled(head + '[constants]\nb = { value = "', "(", '", unit = "m" }\n', n)
    yield "model-expression-minus", "toml", lambda n: filled(head + '[constants]\nb = { value = "', "-", '1", unit = "m" }\n', n)
    yield "model-expression-power", "toml", lambda n: filled(head + '[constants]\na = { value = 1.0, unit = "m" }\nb = { value = "', "a^2*", 'a", unit = "m" }\n', n)
    yield "rig-tables", "rig", lambda n: filled("schema = 1\nname = \"m\"\n", lambda k: f"[a{k}]\n", "", n)
    yield "rig-bodies", "rig", lambda n: filled("schema = 1\nname = \"m\"\n", lambda k: f"[[body]]\nname=\"b{k}\"\nmass=1.0\n", "", n)
    yield "plan-bodies", "plan", lambda n: filled("schema = 1\nname = \"m\"\n", lambda k: f"[[body]]\nname=\"b{k}\"\n", "", n)
    yield "library-kinds", "library", lambda n: filled("", lambda k: f"[[effect_kind]]\nname=\"k{k}\"\non=[\"drive\"]\nexpression=\"c*rate\"\nsays=\"a\"\nparameters={{c={{unit={{force=\"N s/m\",torque=\"N m s/rad\"}}}}}}\n", "", n)
    yield "library-expression", "library", lambda n: filled("[[effect_kind]]\nname=\"k\"\non=[\"drive\"]\nsays=\"a\"\nparameters={c={unit={force=\"N s/m\",torque=\"N m s/rad\"}}}\nexpression=\"c*rate", "+c*rate", "\"\n", n)
    yield "trajectory-blank", "trajectory", lambda n: filled("t,a\n", "\n", "", n)
    yield "trajectory-rows", "trajectory", lambda n: filled("t,a\n", lambda k: f"{k},1\n", "", n)
    yield "closures-nested", "yaml", lambda n: filled("closed_loop: ", "[", "", n)
    yield "closures-list", "yaml", lambda n: filled("closed_loop:\n", "  - [a, b]\n", "", n)
    yield "closures-anchors", "yaml", lambda n: filled("a: &a [1,1]\n", lambda k: f"b{k}: &b{k} [*a,*a]\n", "", n)
    fit = '{"model": "m", "samples": 1, "condition_number": 1.0, "fit": {"nrms": 0.1, "rms": 1.0, "samples": 10, "channels": {}}, "check": null, '
    yield "fit-nested", "fit", lambda n: filled(fit + '"parameters": ', "[", "", n)
    yield "fit-parameters", "fit", lambda n: filled(fit + '"parameters": [', lambda k: ("," if k else "") + f'{{"name":"p{k}","expression":"m","value":1.0,"std":null,"unit":"kg","nominal":null}}', "]}", n)
    yield "fit-covariance", "fit", lambda n: filled(fit + '"parameters": [], "covariance": [[', "1.0,", "1.0]]}", n)
    yield "fit-rows", "fit", lambda n: filled(fit + '"parameters": [], "covariance": [', "[],", "[]]}", n)
    yield "fit-constants", "fit", lambda n: filled(fit + '"parameters": [], "constants": {', lambda k: f'"c{k}":1.0,', '"d":1.0}}', n)
    yield "fit-unknown-keys", "fit", lambda n: filled(fit + '"parameters": []', lambda k: f',"c{k}":[1,[2,{{"a":3}}]]', "}", n)
    yield "fit-escapes", "fit", lambda n: filled(fit + '"parameters": [], "undetermined": ["', "\\u0041", '"]}', n)
    yield "limits-tables", "limits", lambda n: filled("", lambda k: f"[a{k}]\n", "", n)


def mat_element(kind, data):
    pad = -len(data) % 8
    return struct.pack("<II", kind, len(data)) + data + b"\0" * pad


def mat_variables(path, size):
    """Many variables of one number each."""
    with open(path, "wb") as out:
        out.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM")
        k = 0
        while out.tell() < size:
            matrix = mat_element(6, struct.pack("<II", 6, 0)) + mat_element(5, struct.pack("<ii", 1, 1))
            matrix += mat_element(1, f"v{k}".encode()) + mat_element(9, struct.pack("<d", 1.0))
            out.write(mat_element(14, matrix))
            k += 1


def mat_columns(path, size):
    """Few long columns."""
    n = max(1, size // 24)
    with open(path, "wb") as out:
        out.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM")
        for name in ["t", "q1", "q2"]:
            matrix = mat_element(6, struct.pack("<II", 6, 0)) + mat_element(5, struct.pack("<ii", n, 1))
            matrix += mat_element(1, name.encode()) + mat_element(9, struct.pack("<d", 1.0) * n)
            out.write(mat_element(14, matrix))


def mat_cells(path, size):
    """Nested cells."""
    with open(path, "wb") as out:
        out.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM")
        head = mat_element(6, struct.pack("<II", 1, 0)) + mat_element(5, struct.pack("<ii", 1, 1)) + mat_element(1, b"c")
        n = max(1, size // (len(head) + 8))
        left = n * (len(head) + 8)
        for _ in range(n):
            left -= 8
            out.write(struct.pack("<II", 14, left) + head)
            left -= len(head)


def sqlite_bag(path, size, n_topics, payload):
    path.unlink(missing_ok=True)
    data = sqlite3.connect(path)
    data.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,"
        "offered_qos_profiles TEXT NOT NULL);CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
        "timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
    )
    n_topics = max(1, n_topics(size))
    topics = ((k + 1, f"/t{k}", "sensor_msgs/msg/JointState", "cdr", "") for k in range(n_topics))
    data.executemany("INSERT INTO topics VALUES(?,?,?,?,?)", topics)
    n = max(1, size // (payload + 20))
    rows = ((k + 1, k % n_topics + 1, k * 1000000, b"\0\1\0\0" + b"\0" * payload) for k in range(n))
    data.executemany("INSERT INTO messages VALUES(?,?,?,?)", rows)
    data.commit()
    data.close()


def binaries():
    """Binary files: name, ending, function that writes a file of about a size."""
    yield "mat-variables", "mat", mat_variables
    yield "mat-columns", "mat", mat_columns
    yield "mat-cells", "mat", mat_cells
    yield "db3-topics", "db3", lambda path, n: sqlite_bag(path, n, lambda size: size // 120, 24)
    yield "db3-messages", "db3", lambda path, n: sqlite_bag(path, n, lambda size: 1, 4)
    yield "db3-long-messages", "db3", lambda path, n: sqlite_bag(path, n, lambda size: 1, 900000)

    def packed(path, n):
        with gzip.open(path, "wb", 1) as out:
            # Text that hardly packs, so that the packed file has the size.
            noise = os.urandom(1 << 20).hex()
            rows = "t,q1,q2\n" + "".join(f"{k},{noise[k % 1000000:k % 1000000 + 12]},1\n" for k in range(max(1, n // 8)))
            out.write(rows.encode())

    yield "gzip-words", "csv.gz", packed
    try:
        import h5py
        import numpy as np
    except ImportError:
        h5py = None
    if h5py:
        def datasets(path, n, groups=False, latest=False):
            with h5py.File(path, "w", libver="latest" if latest else "earliest") as out:
                for k in range(max(1, n // (1200 if groups else 500))):
                    place = out.create_group(f"g{k}") if groups else out
                    place.create_dataset(f"d{k}", data=np.zeros(2))

        def chunks(path, n):
            with h5py.File(path, "w") as out:
                for name in ["t", "q1", "q2"]:
                    out.create_dataset(name, data=np.random.rand(max(2, n // 40)), chunks=(1,))

        def nested(path, n):
            with h5py.File(path, "w") as out:
                place = out
                for k in range(max(1, n // 800)):
                    place = place.create_group("g")
                    if k > 20000:
                        break
                out.create_dataset("t", data=np.zeros(n // 8))

        def attributes(path, n):
            with h5py.File(path, "w", libver="latest") as out:
                one = out.create_dataset("t", data=np.zeros(3))
                for k in range(max(1, n // 100)):
                    one.attrs[f"a{k}"] = 1.0

        def wide(path, n):
            with h5py.File(path, "w") as out:
                out.create_dataset("t", data=np.zeros((2, max(1, n // 16))))

        def packed_chunks(path, n):
            with h5py.File(path, "w") as out:
                for name in ["t", "q1", "q2"]:
                    out.create_dataset(name, data=np.random.rand(max(2, n // 24)), chunks=(1000,), compression="gzip", shuffle=True)

        def strings(path, n):
            with h5py.File(path, "w") as out:
                out.create_dataset("t", data=["a" * 20] * max(1, n // 50))

        yield "hdf5-datasets", "h5", datasets
        yield "hdf5-datasets-latest", "h5", lambda path, n: datasets(path, n, latest=True)
        yield "hdf5-groups", "h5", lambda path, n: datasets(path, n, groups=True)
        yield "hdf5-chunks", "h5", chunks
        yield "hdf5-packed-chunks", "h5", packed_chunks
        yield "hdf5-nested", "h5", nested
        yield "hdf5-attributes", "h5", attributes
        yield "hdf5-wide", "h5", wide
        yield "hdf5-strings", "h5", strings
    try:
        import numpy as np
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        return
    names = ["t", "q1", "q2"]

    def columns(path, n):
        values = np.random.rand(max(2, n // 24))
        pq.write_table(pa.table({name: values for name in names}), path, use_dictionary=False)

    def groups(path, n):
        table = pa.table({name: np.zeros(max(2, n // 800)) for name in names})
        pq.write_table(table, path, row_group_size=1)

    def many_columns(path, n):
        pq.write_table(pa.table({f"c{k}": np.zeros(2) for k in range(max(2, n // 500))}), path)

    def lists(path, n):
        rows = max(2, n // 100)
        pq.write_table(pa.table({"t": np.arange(rows), "q": [[1.0] * 10] * rows}), path, use_dictionary=False, compression=None)

    def texts_of(path, n):
        pq.write_table(pa.table({"t": [f"{k:020d}" for k in range(max(2, n // 24))]}), path, use_dictionary=False, compression=None)

    yield "parquet-columns", "parquet", columns
    yield "parquet-row-groups", "parquet", groups
    yield "parquet-many-columns", "parquet", many_columns
    yield "parquet-lists", "parquet", lists
    yield "parquet-texts", "parquet", texts_of
    try:
        from mcap.writer import Writer
    except ImportError:
        return

    def mcap(path, n, part):
        with open(path, "wb") as out:
            writer = Writer(out, chunk_size=1 << 20)
            writer.start()
            part(writer, n)
            writer.finish()

    definition = b"std_msgs/Header header\nfloat64[] position\n" + b"=" * 80 + b"\nMSG: std_msgs/Header\nuint32 seq\n"

    def channels(writer, n):
        schema = writer.register_schema("a/B", "ros2msg", definition)
        for k in range(min(65000, max(1, n // 200))):
            channel = writer.register_channel(f"/t{k}", "cdr", schema)
            writer.add_message(channel, k, b"\0" * 24, k)

    def schemas(writer, n):
        for k in range(min(65000, max(1, n // 400))):
            schema = writer.register_schema(f"a/B{k}", "ros2msg", definition)
            writer.add_message(writer.register_channel(f"/t{k}", "cdr", schema), k, b"\0" * 24, k)

    def messages(writer, n):
        schema = writer.register_schema("a/B", "ros2msg", b"float64 a\nfloat64 b\n")
        channel = writer.register_channel("/t", "cdr", schema)
        for k in range(max(1, n // 25)):
            writer.add_message(channel, k * 1000000, b"\0\1\0\0" + os.urandom(16), k)

    def long_schema(writer, n):
        schema = writer.register_schema("a/B", "ros2msg", b"".join(b"float64 a%d\n" % k for k in range(max(1, n // 14))))
        writer.add_message(writer.register_channel("/t", "cdr", schema), 1, b"\0" * 24, 1)

    for part in [channels, schemas, messages, long_schema]:
        name = part.__name__.replace("_", "-")
        yield f"mcap-{name}", "mcap", lambda path, n, part=part: mcap(path, n, part)


def command(ending, path, folder):
    """Arguments of the commands that read a file of this kind."""
    out = str(folder / "out.toml")
    path = str(path)
    if ending in ("urdf", "xml", "sdf"):
        return [["import", path, "--out", out]]
    if ending == "toml":
        return [["check", path]]
    if ending == "rig":
        return [["simulate", path, "--trajectory", str(ROOT / "recordings/spidermill-mbs/plain-check.csv"), "--out", out]]
    if ending == "plan":
        return [["reduce", str(RIG), "--plan", path, "--out", out]]
    if ending == "library":
        return [["effects", "--library", path]]
    if ending == "trajectory":
        return [["simulate", str(RIG), "--trajectory", path, "--out", out]]
    if ending == "yaml":
        robot = folder / "robot.urdf"
        robot.write_text("<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='revolute'><parent link='a'/>"
                         "<child link='b'/><axis xyz='0 0 1'/><limit effort='1' velocity='1'/></joint></robot>")
        return [["import", str(robot), "--closures", path, "--out", out]]
    run = folder / "run.csv"
    run.write_text("t,q1,q2,joint1,joint2\n" + "".join(f"{k * 0.01},{k * 0.01},{k * 0.02},1,2\n" for k in range(300)))
    if ending == "fit":
        return [["compare", str(MODEL), "--data", str(run), "--parameters", path]]
    if ending == "limits":
        return [["verify", str(MODEL), "--data", str(run), "--limits", path]]
    return [["compare", str(MODEL), "--data", path, *MAP], ["recordings", path]]


def measured(program, args, limit):
    """Exit status, seconds of the processor, largest resident memory in MB and the first line of the message. The command
    runs under `time`, since a process that Python forks begins with the memory of Python."""
    shell = f"ulimit -v {12 << 20}; ulimit -t {int(limit) + 1}; exec \"$0\" \"$@\""
    ran = subprocess.run(
        ["/usr/bin/time", "-f", "%M %U %S", "sh", "-c", shell, program, *args],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )
    lines = ran.stderr.decode(errors="replace").splitlines()
    memory, user, system = (float(word) for word in lines.pop().split())
    words = next((line for line in lines if "error" in line), lines[0] if lines else "")
    return ran.returncode, user + system, memory / 1000, words


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program")
    arguments.add_argument("--sizes", default="1,10", help="MB")
    arguments.add_argument("--folder", default="target/large-files")
    arguments.add_argument("--only", default="")
    request = arguments.parse_args()
    folder = pathlib.Path(request.folder)
    folder.mkdir(parents=True, exist_ok=True)
    n_bad = n_files = 0
    kinds = [(name, ending, None, text) for name, ending, text in texts()]
    kinds += [(name, ending, write, None) for name, ending, write in binaries()]
    for name, ending, write, text in kinds:
        if request.only not in name:
            continue
        for size in (float(s) for s in request.sizes.split(",")):
            path = folder / f"{name}.{ending}"
            n = int(size * 1e6)
            if text:
                path.write_text(text(n), newline="")
            else:
                write(path, n)
            mb = path.stat().st_size / 1e6
            for args in command(ending, path, folder):
                limit = 5 * MOST_SECONDS_PER_MB * mb + 5
                status, seconds, memory, words = measured(request.program, args, min(limit, 300))
                n_files += 1
                slow = seconds > MOST_SECONDS_PER_MB * mb + START_SECONDS
                large = memory > MOST_TIMES_THE_SIZE * mb + PROGRAM_MB
                killed = status not in (0, 1, 2)
                bad = slow or large or killed
                n_bad += bad
                mark = "FAIL" if bad else "ok  "
                print(f"{mark} {name:28} {args[0]:10} {mb:6.1f} MB status {status:3} {seconds:7.2f} s {seconds / mb:7.3f} s/MB "
                      f"{memory:7.0f} MB {memory / mb:6.1f} x  {words[:150]}", flush=True)
            path.unlink()
    print(f"{n_files} runs, {n_bad} beyond the limits")
    sys.exit(1 if n_bad else 0)


if __name__ == "__main__":
    main()
