#!/bin/sh
#SBATCH --job-name=vkt-filter
#SBATCH --array=0-7
#SBATCH --cpus-per-task=4
#SBATCH --mem=4G
#SBATCH --time=00:30:00
# An array job that works on many volumes: each task takes every N-th, N being the number of tasks.
#
#     sbatch filter-array.sh IN OUT        # folders of .nrrd files and of results
#     SLURM_ARRAY_TASK_ID=0 sh filter-array.sh IN OUT    # without Slurm: the first task of one
#
# vkt takes as many threads as the task has (SLURM_CPUS_PER_TASK) and stays below the memory of its control group. A result
# appears when it is whole and is not made twice, so a job that was cut off is submitted again as it was.
# SPDX-License-Identifier: MIT
set -eu
in=${1:?usage: filter-array.sh IN OUT}
out=${2:?usage: filter-array.sh IN OUT}
task=${SLURM_ARRAY_TASK_ID:-0}
first=${SLURM_ARRAY_TASK_MIN:-0}
tasks=${SLURM_ARRAY_TASK_COUNT:-1}
mkdir -p "$out"

number=0
failed=0
for volume in "$in"/*.nrrd; do
    [ -e "$volume" ] || {
        echo "filter-array.sh: there is no .nrrd file in $in" >&2
        exit 1
    }
    mine=$((number % tasks))
    number=$((number + 1))
    [ "$mine" -eq $((task - first)) ] || continue
    result=$out/$(basename "$volume")
    [ ! -e "$result" ] || continue
    # One that fails does not keep the others from being done; the task fails at its end.
    vkt filter median "$volume" --radius 1 | vkt filter gaussian --sigma 1 |
        vkt write "$result" --compress || failed=1
done
exit $failed
