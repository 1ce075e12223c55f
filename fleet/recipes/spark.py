"""Evaluates a fleet with Spark Connect: summaries of recordings, then parameters of each robot and day, as Arrow tables.

    python spark.py sc://HOST:PORT FOLDER plan.json out.csv

The folder has files `robot=R/day=D/recording=N/FILE`, with the same path on all workers. Workers need the wheel; `check` next to
this file tests it with pysail 0.7 and pyspark 4.0.
"""

import sys
from pathlib import Path

import pyarrow as pa
from modelmill import ModelmillError, fleet
from pyspark.sql import SparkSession
from pyspark.sql import functions as f

SUMMARIES = pa.schema({"robot": pa.string(), "day": pa.string(), "summary": pa.binary()})
PARAMETERS = pa.schema(
    {"robot": pa.string(), "day": pa.string(), "name": pa.string(), "value": pa.float64(), "std": pa.float64()}
)


def of_files(spark, folder, plan):
    """Parameters from recordings in files of any format; a worker reads a complete file, and only summaries are sent."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    rows = [(*(part.split("=", 1)[1] for part in path.parts[-4:-1]), str(path)) for path in files]

    def summarised(batches):
        for batch in batches:
            told = [
                {"robot": row["robot"], "day": row["day"], "summary": fleet.summarise(plan, row["path"], named(row))}
                for row in batch.to_pylist()
            ]
            yield from pa.Table.from_pylist(told, SUMMARIES).to_batches()

    table = spark.createDataFrame(rows, "robot string, day string, recording string, path string")
    return parameters(table.mapInArrow(summarised, "robot string, day string, summary binary"), plan)


def of_samples(samples, plan):
    """Parameters from a table of samples with `robot`, `day` and `recording`, with rows in any order."""

    def summarised(key, rows):
        robot, day, recording = (one.as_py() for one in key)
        name = named({"robot": robot, "day": day, "recording": recording})
        summary = fleet.summarise(plan, rows, name)
        return pa.Table.from_pylist([{"robot": robot, "day": day, "summary": summary}], SUMMARIES)

    numbers = [f.col(name).cast("double").alias(name) for name in fleet.columns(plan)]
    texts = [f.col(name).cast("string").alias(name) for name in ("robot", "day", "recording")]
    groups = samples.select(*texts, *numbers).groupBy("robot", "day", "recording")
    return parameters(groups.applyInArrow(summarised, "robot string, day string, summary binary"), plan)


def parameters(summaries, plan):
    """Base parameters per robot and day from a table of summaries; a day without a usable recording has no rows."""

    def solved(key, rows):
        robot, day = (one.as_py() for one in key)
        try:
            told = fleet.solve(plan, fleet.merge(rows["summary"].to_pylist()))["parameters"]
        except ModelmillError:
            told = []
        told = [{"robot": robot, "day": day, **{k: one[k] for k in ("name", "value", "std")}} for one in told]
        return pa.Table.from_pylist(told, PARAMETERS)

    columns = "robot string, day string, name string, value double, std double"
    return summaries.groupBy("robot", "day").applyInArrow(solved, columns)


def named(row):
    return f"{row['robot']}/{row['day']}/{row['recording']}"


if __name__ == "__main__":
    url, folder, path, out = sys.argv[1:]
    plan = Path(path).read_text()
    spark = SparkSession.builder.remote(url).getOrCreate()
    of_files(spark, folder, plan).toPandas().to_csv(out, index=False)
