"""libfclib itself, where Debian's libfclib-dev and gcc are installed."""

from __future__ import annotations

import shutil
import subprocess

import pytest

PROGRAM = r"""
#include <stdio.h>
#include <math.h>
#include <fclib.h>
static double sum(double *x, int n) {
  double s = 0;
  for (int k = 0; k < n; k++) s += x[k] * (k + 1);
  return s;
}
static void show(const char *name, struct fclib_matrix *A) {
  if (!A) return;
  int n = A->nz >= 0 ? A->nz : (A->nz == -1 ? A->p[A->n] : A->p[A->m]);
  long i = 0; for (int k = 0; k < n; k++) i += (long)(k + 1) * A->i[k];
  printf("%s %d %d %d %d %ld %.17g\n", name, A->m, A->n, A->nz, A->nzmax, i, sum(A->x, n));
}
int main(int argc, char **argv) {
  if (argv[1][0] == 'l') {
    struct fclib_local *P = fclib_read_local(argv[2]);
    show("W", P->W); show("V", P->V); show("R", P->R);
    printf("q %.17g\n", sum(P->q, P->W->m));
    struct fclib_solution *S = argc > 3 ? fclib_read_solution(argv[2]) : 0;
    if (S && P->spacedim == 3) printf("merit %.17g\n", fclib_merit_local(P, MERIT_1, S));
  } else {
    struct fclib_global *P = fclib_read_global(argv[2]);
    show("M", P->M); show("H", P->H); show("G", P->G);
    printf("f %.17g\nw %.17g\n", sum(P->f, P->M->m), sum(P->w, P->H->n));
    struct fclib_solution *S = argc > 3 ? fclib_read_solution(argv[2]) : 0;
    if (S) printf("v %.17g\n", sum(S->v, P->M->m));
  }
  return 0;
}
"""


def built(folder):
    """Return how to ask libfclib what it reads from a file."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    (folder / "ask.c").write_text(PROGRAM)
    made = subprocess.run(
        ["gcc", "-w", "-I/usr/include/hdf5/serial", "ask.c", "-o", "ask", "-lfclib", "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode:
        pytest.skip(f"libfclib-dev is not installed: {made.stderr.splitlines()[0]}")

    def ask(kind, path, *more):
        done = subprocess.run(
            [str(folder / "ask"), kind, str(path), *more],
            capture_output=True,
            text=True,
            check=True,
        )
        lines = [line.split() for line in done.stdout.splitlines() if line]
        return {line[0]: [float(word) for word in line[1:]] for line in lines}

    return ask
