"""Compares the results of the recipes with `results.json` of one process.

    python hold.py sc://HOST:PORT FOLDER plan.json results.json

Unreadable files are deleted before the samples are read as one table, which needs every file to be readable.
"""

import json
import sys
import time
from pathlib import Path

import spark as recipe
from pyspark import cloudpickle
from pyspark.sql import SparkSession

# Workers cannot import the recipe, so it is sent to them by value.
cloudpickle.register_pickle_by_value(recipe)


def connected(url):
    """A session, once the server listens."""
    for _ in range(30):
        try:
            spark = SparkSession.builder.remote(url).getOrCreate()
            spark.range(1).collect()
            return spark
        except Exception as error:
            last = error
            time.sleep(1)
    raise last


def of_one_process(results):
    """Values and standard deviations of the parameters, by robot and day."""
    return {
        (robot["robot"], day["day"]): list(zip(day["values"], day["std"]))
        for robot in results["robots"]
        for day in robot["days"]
        if day["values"] is not None
    }


def is_near(a, b):
    return a == b or (a is not None and b is not None and abs(a - b) <= 1e-9 * max(abs(a), 1e-3))


def hold(name, table, expected):
    found = {}
    for row in table.toArrow().to_pylist():
        found.setdefault((row["robot"], row["day"]), []).append((row["value"], row["std"]))
    assert found.keys() == expected.keys(), (name, found.keys() ^ expected.keys())
    for key, pairs in expected.items():
        assert len(found[key]) == len(pairs), (name, key)
        for (a, b), (c, d) in zip(pairs, found[key]):
            assert is_near(a, c) and is_near(b, d), (name, key, (a, b), (c, d))
    n = sum(map(len, found.values()))
    print(f"{name}: {n} parameters of {len(found)} robots and days agree with those of one process")


def main():
    url, folder, path, results = sys.argv[1:]
    plan = Path(path).read_text()
    results = json.loads(Path(results).read_text())
    expected = of_one_process(results)
    assert expected and results["bad"]
    spark = connected(url)
    hold("files", recipe.of_files(spark, folder, plan), expected)
    for one in results["bad"]:
        Path(folder, one["recording"]).unlink()
    hold("samples", recipe.of_samples(spark.read.parquet(folder), plan), expected)


if __name__ == "__main__":
    main()
