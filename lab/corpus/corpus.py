"""Judges the import of all robot descriptions that installed packages ship, and prints a table by package.

usage: corpus.py PROGRAM [--only PACKAGE] [--file PART] [--limit SECONDS] [--table FILE] [--log FILE] [--floating] [--from LOG...]

The exit status is 1 if a description is wrong.
"""

import argparse
import collections
import json
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

import descriptions
import judge

VERDICTS = ("right", "left out", "no motion", "both refuse", "refused", "not judged", "wrong", "time")
HEADS = (
    "package", "files", "right", "left out", "nothing moves", "both refuse", "refused", "not judged", "wrong", "over time", "s",
)


def work(program, description, sender, floats):
    """The child process: judges one file, in a process group of its own."""
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with tempfile.TemporaryDirectory() as folder:
        # MuJoCo writes a log where it runs.
        os.chdir(folder)
        report = judge.Report(sender.send)
        try:
            judge.judge(program, description, Path(folder), report, floats)
        except Exception as fault:
            report.end("not judged", f"fault of the judge: {type(fault).__name__}: {fault}")
    sender.close()


def judge_within(program, description, limit, floats):
    """The report on one file; what was known at the time limit if it is over. A crash of a peer ends its process only."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.Process(target=work, args=(program, description, sender, floats))
    start = time.monotonic()
    child.start()
    sender.close()
    report = {"verdict": "time", "why": "", "said": "", "seconds": {}, "stage": "start"}
    try:
        while receiver.poll(max(0.0, start + limit - time.monotonic())):
            report = receiver.recv()
    except EOFError:
        if report["stage"] != "end":
            report |= {"verdict": "not judged", "why": f"the process ended during {report['stage']}"}
    except BaseException:
        end_group(child)
        raise
    if report["verdict"] == "time":
        report["why"] = f"over {limit} s during {report['stage']}"
    end_group(child)
    return report | {"total": time.monotonic() - start}


def end_group(child):
    """Ends a child process with all that it started."""
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    child.join()


def row_of(package, reports):
    """The cells of a package in the table."""
    count = collections.Counter(report["verdict"] for report in reports)
    total = sum(report["total"] for report in reports)
    return [package, sum(count[one] for one in VERDICTS), *(count[one] for one in VERDICTS), round(total)]


def table_of(by_package):
    """The rows of the table, the last with the sums."""
    rows = [row_of(package, reports) for package, reports in by_package.items()]
    return rows + [["all", *(sum(column) for column in list(zip(*rows))[1:])]] if rows else []


def markdown(rows, versions):
    """The table for the guide."""
    named = [[f"{row[0]} {versions.get(row[0], '')}".strip(), *row[1:]] for row in rows]
    lines = ["| " + " | ".join(HEADS) + " |", "|---|" + "---:|" * (len(HEADS) - 1)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in named]) + "\n"


def refusals(reports):
    """Reasons of refusals with their number, and whether they are true."""
    refused = [one for one in reports if one["verdict"] in ("refused", "both refuse")]
    count = collections.Counter((one.get("short", ""), one.get("reason", ""), one.get("saved", "")) for one in refused)
    saved_as = {key: f" [as MuJoCo saves it: {key[2]}]" if key[2] else "" for key in count}
    return [f"{n:4} ({key[1]}) {key[0]}{saved_as[key]}" for key, n in count.most_common()]


def saved_line(reports):
    """What became of refused files once MuJoCo had saved them."""
    count = collections.Counter(one["saved"] for one in reports if one["verdict"] == "refused" and "saved" in one)
    numbers = ", ".join(f"{n} {verdict}" for verdict, n in count.most_common())
    return f"Of the refused, as MuJoCo saves them: {numbers or 'none'}."


def print_report(description, report):
    """One line for each file that is not right."""
    if report["verdict"] not in ("right", "part", "no motion"):
        seconds = " ".join(f"{stage} {value:.1f}" for stage, value in report["seconds"].items())
        why = " ".join(report["why"].split())[:400]
        saved = f" [as MuJoCo saves it: {report['saved']} {report['saved why'][:200]}]" if "saved" in report else ""
        print(f"{report['verdict']:11} {description.package} {description.name} ({seconds}): {why}{saved}", flush=True)


def read_log(paths):
    """The reports of earlier runs by package; a later report on a file replaces an earlier one."""
    found = {}
    for path in paths:
        for line in path.read_text().splitlines():
            report = json.loads(line)
            found[report["package"], report["file"]] = report
    by_package = {}
    for (package, _), report in found.items():
        by_package.setdefault(package, []).append(report)
    return by_package


def run_all(chosen):
    """Judges all chosen files; the reports by package."""
    log = chosen.log.open("w") if chosen.log else None
    by_package = {}
    for package in [chosen.only] if chosen.only else descriptions.versions():
        found = descriptions.find_descriptions(package)
        if found is None:
            print(f"{package} is not installed", flush=True)
        for description in found or ():
            if chosen.file in str(description.path):
                report = judge_within(chosen.program.resolve(), description, chosen.limit, chosen.floating)
                by_package.setdefault(package, []).append(report)
                print_report(description, report)
                if log:
                    print(json.dumps({"package": package, "file": str(description.path)} | report), file=log, flush=True)
    return by_package


def main():
    """Reads the command line, judges or reads logs, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", type=Path)
    parser.add_argument("--only", help="one package")
    parser.add_argument("--file", default="", help="only files with this in their path")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each file")
    parser.add_argument("--table", type=Path, help="write the table to this file as Markdown")
    parser.add_argument("--log", type=Path, help="write one line of JSON for each file")
    parser.add_argument("--from", dest="logs", type=Path, nargs="+", help="make the table from these logs, without judging")
    parser.add_argument("--floating", action="store_true", help="import each URDF with a free root")
    chosen = parser.parse_args()
    # An end from outside also ends the child process.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    by_package = read_log(chosen.logs) if chosen.logs else run_all(chosen)
    everything = [report for reports in by_package.values() for report in reports]
    table, saved = table_of(by_package), saved_line(everything)
    print("\n".join(refusals(everything)))
    print(markdown(table, {}) + "\n" + saved)
    if chosen.table:
        chosen.table.write_text(markdown(table, descriptions.versions()) + "\n" + saved + "\n")
    sys.exit(any(report["verdict"] == "wrong" for report in everything))


if __name__ == "__main__":
    main()
