"""The figures of the thesis: see toolchain/study."""
from haptic import study
from programs import HOST_SIM, refuse_machines

# Number and what it shows: results, or times.
FIGURES = dict(line.split()[:2] for line in study.output_of([HOST_SIM, "reproduce", "--list"]).splitlines())


def reproduce(figure, folder):
    """Makes the figures of the thesis in a folder, with one page of all."""
    study.output_of([HOST_SIM, "reproduce", figure, "--out", folder])
    return {"shows": FIGURES[figure]}


if __name__ == "__main__":
    refuse_machines("each run adds its figure to the folder and the page on this machine")
    study.main(reproduce, alone=lambda figure, folder: FIGURES.get(figure) == "times", figure=list(FIGURES),
               folder=["build/reproduction"])
