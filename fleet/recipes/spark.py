"""A fleet through Spark Connect: one recording a group for summaries, one robot and day a group for parameters.

    python spark.py sc://HOST:PORT FOLDER plan.json out.csv

The folder has partitions `robot=`, `day=` and `recording=`. Workers need the wheel; tried with pysail 0.7.2 and pyspark 4.0.
"""

import sys

import pandas as pd
from modelmill import fleet
from pyspark.sql import SparkSession
from pyspark.sql import functions as f


def run(spark, samples, plan):
    """Base parameters per robot and day of a table of samples with `robot`, `day` and `recording`."""

    def summarised(key, rows):
        robot, day, recording = key
        name = f"{robot}/{day}/{recording}"
        return pd.DataFrame({"robot": [robot], "day": [day], "summary": [fleet.summarise(plan, rows, name)]})

    def solved(key, rows):
        robot, day = key
        fit = fleet.solve(plan, fleet.merge(rows["summary"]))
        told = [(robot, day, one["name"], one["value"], one["std"]) for one in fit["parameters"]]
        return pd.DataFrame(told, columns=["robot", "day", "name", "value", "std"])

    columns = fleet.columns(plan)
    numbers = [f.col(name).cast("double").alias(name) for name in columns]
    texts = [f.col(name).cast("string").alias(name) for name in ("robot", "day", "recording")]
    summaries = (
        samples.select(*texts, *numbers)
        .groupBy("robot", "day", "recording")
        .applyInPandas(summarised, "robot string, day string, summary binary")
    )
    return summaries.groupBy("robot", "day").applyInPandas(
        solved, "robot string, day string, name string, value double, std double"
    )


if __name__ == "__main__":
    url, folder, path, out = sys.argv[1:]
    with open(path) as text:
        plan = text.read()
    spark = SparkSession.builder.remote(url).getOrCreate()
    run(spark, spark.read.parquet(folder), plan).toPandas().to_csv(out, index=False)
