#!/bin/sh
# Which seeds the runs of a Mesa batch get.
#
# Installs a pinned mesa in a temporary folder and runs a small model that draws one number; nothing of sleepcast runs. Needs
# Python 3.12 or newer with venv (PYTHON=...), and the network. A model takes rng; seed, its older name, is deprecated. One would
# guess that batch_run gives models the seeds that stand among its parameters, as any other parameter, and that more
# iterations are other runs. As of Mesa 3.5.1:
#
#   parameters={"rng": [1, 2]}           the seeds are replaced by None without a word, in the table as well: no run can
#                                        be repeated
#   parameters={"seed": 7}, iterations=3   where the model takes **kwargs, the same run three times: three rows for one
#   batch_run(..., rng=[1, 2])           the runs have these seeds
#
# So a study looks seeded and is not, or has fewer samples than rows. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check mesa==3.5.1 networkx==3.6.1 numpy==2.4.6 pandas==3.1.1 scipy==1.17.1 \
    2> pip.log || { cat pip.log >&2; exit 1; }
cat > batch.py << 'SCRIPT'
import mesa


class Draws(mesa.Model):
    def __init__(self, **seeds):
        super().__init__(**seeds)
        self.given = next(iter(seeds.values()), None)
        self.drawn = self.random.random()
        self.datacollector = mesa.DataCollector(
            model_reporters={"drawn": lambda model: model.drawn, "given": lambda model: str(model.given)}
        )

    def step(self):
        self.datacollector.collect(self)


class Named(Draws):
    def __init__(self, rng=None):
        super().__init__(rng=rng)


def run(model, **settings):
    rows = mesa.batch_run(model, max_steps=1, number_processes=1, display_progress=False, **settings)
    return [row["drawn"] for row in rows], [row["given"] for row in rows], [str(row["rng"]) for row in rows]


for name, model, settings in (
    ("rng among the parameters", Named, {"parameters": {"rng": [1, 2]}}),
    ("seed among the parameters", Draws, {"parameters": {"seed": 7}, "iterations": 3}),
    ("rng of the batch", Named, {"parameters": {}, "rng": [1, 2]}),
):
    (drawn, given, told), (again, *_) = run(model, **settings), run(model, **settings)
    print(f"{name}: given {' '.join(given)}; {len(set(drawn))} of {len(drawn)} runs differ;", end=" ")
    print("run again the same;" if drawn == again else "run again others;", "column rng:", *told)
SCRIPT
here/bin/python -W ignore batch.py > found
cat > wanted << 'WANTED'
rng among the parameters: given None None; 2 of 2 runs differ; run again others; column rng: None None
seed among the parameters: given 7 7 7; 1 of 3 runs differ; run again the same; column rng: None None None
rng of the batch: given 1 2; 2 of 2 runs differ; run again the same; column rng: 1 2
WANTED
echo "mesa 3.5.1, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
