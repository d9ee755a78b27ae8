#!/usr/bin/python3
# Draws error against seconds for the reconstructions of hierarchical volumes.
# SPDX-License-Identifier: MIT
#
#   amr_accuracy.py TABLE.csv CHART.png       TABLE: what vkt_amr_bench accuracy prints
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

rows = list(csv.DictReader(open(sys.argv[1])))
places = list(dict.fromkeys(row["where"] for row in rows))
figure, axes = plt.subplots(1, len(places), figsize=(5 * len(places), 4.5), sharey=True)
for axis, place in zip(axes, places):
    for method in dict.fromkeys(row["method"] for row in rows):
        points = [row for row in rows if row["method"] == method and row["where"] == place]
        seconds = [float(row["seconds"]) for row in points]
        errors = [max(float(row["rms_error"]), 1e-9) for row in points]
        axis.loglog(seconds, errors, "o-", label=method)
        for row, x, y in zip(points, seconds, errors):
            axis.annotate(row["samples_per_finest_cell"], (x, y), fontsize=6, xytext=(3, 3), textcoords="offset points")
    axis.set_title(place)
    axis.set_xlabel("seconds")
    axis.grid(True, which="both", alpha=0.2)
axes[0].set_ylabel("RMS error / standard deviation of the field")
axes[0].legend(title="labels: samples per finest cell")
figure.tight_layout()
figure.savefig(sys.argv[2], dpi=120)
