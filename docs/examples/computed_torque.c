/*
 * A computed-torque controller with an exported arm, in one file:
 *
 *   lip_id export model.npz --name arm --c arm.h
 *   cc -std=c11 -O2 -o computed_torque computed_torque.c -lm && ./computed_torque
 *
 * `control` is what a controller of one's own calls in each cycle. The rest stands for the robot:
 * it solves the same equations of motion for the accelerations, so that the program can be tried
 * where there is no robot. It prints the largest position error and fails where that is large.
 */
#include "arm.h"

#include <stdio.h>

#define N ARM_JOINTS
#define PERIOD 1e-3   /* of the controller [s] */
#define SUBSTEPS 5    /* of the simulation, per period */
#define DURATION 4.0  /* [s] */
#define STIFFNESS 400.0
#define DAMPING 40.0  /* both per unit of inertia: a double pole at 20 rad/s */
#define AMPLITUDE 0.2 /* of the reference [rad or m] */
#define LARGE 1e-2    /* position error [rad or m] */

typedef struct reference {
  double q[N], dq[N], ddq[N];
} reference;

static const double still[N] = {0.0};

/*
 * Torques that follow a reference: the links' at the acceleration that corrects errors, and the
 * friction of the wanted velocity. Acceleration softens the friction of arm_torque, as a low-pass
 * does that of recorded torques; an arm would stick.
 */
static void control(const double *q, const double *dq, const reference *wanted, double *tau) {
  double ddq[N], friction[N], kinetic, potential;
  int i;
  for (i = 0; i < N; i++) {
    ddq[i] = wanted->ddq[i] + DAMPING * (wanted->dq[i] - dq[i]) +
             STIFFNESS * (wanted->q[i] - q[i]);
  }
  arm_links_torque(q, dq, ddq, tau, &kinetic, &potential);
  arm_friction(q, wanted->dq, still, tau, friction);
  for (i = 0; i < N; i++) tau[i] += friction[i];
}

/* Solve A x = b in place by Cholesky's factorisation; A is an inertia matrix, row by row. */
static void solve(double *a, double *x) {
  int i, j, k;
  for (j = 0; j < N; j++) {
    for (k = 0; k < j; k++) a[N * j + j] -= a[N * j + k] * a[N * j + k];
    a[N * j + j] = sqrt(a[N * j + j]);
    for (i = j + 1; i < N; i++) {
      for (k = 0; k < j; k++) a[N * i + j] -= a[N * i + k] * a[N * j + k];
      a[N * i + j] /= a[N * j + j];
    }
  }
  for (i = 0; i < N; i++) {
    for (k = 0; k < i; k++) x[i] -= a[N * i + k] * x[k];
    x[i] /= a[N * i + i];
  }
  for (i = N - 1; i >= 0; i--) {
    for (k = i + 1; k < N; k++) x[i] -= a[N * k + i] * x[k];
    x[i] /= a[N * i + i];
  }
}

/* The robot: move under torques for one period. */
static void move(double *q, double *dq, const double *tau) {
  double inertia[N * N], ddq[N];
  int step, i;
  for (step = 0; step < SUBSTEPS; step++) {
    arm_torque(q, dq, still, ddq); /* without acceleration: Coriolis, gravity, friction */
    for (i = 0; i < N; i++) ddq[i] = tau[i] - ddq[i];
    arm_inertia_matrix(q, inertia);
    solve(inertia, ddq);
    for (i = 0; i < N; i++) {
      dq[i] += PERIOD / SUBSTEPS * ddq[i];
      q[i] += PERIOD / SUBSTEPS * dq[i];
    }
  }
}

/* A slow swing of every joint, each with a frequency of its own, that begins at rest. */
static void refer(double t, reference *wanted) {
  int i;
  for (i = 0; i < N; i++) {
    const double w = 1.0 + 0.3 * i;
    wanted->q[i] = AMPLITUDE * (1.0 - cos(w * t));
    wanted->dq[i] = AMPLITUDE * w * sin(w * t);
    wanted->ddq[i] = AMPLITUDE * w * w * cos(w * t);
  }
}

int main(void) {
  double q[N] = {0.0}, dq[N] = {0.0}, tau[N], largest = 0.0, t;
  int i;
  for (t = 0.0; t < DURATION; t += PERIOD) {
    reference wanted;
    refer(t, &wanted);
    for (i = 0; i < N; i++) largest = fmax(largest, fabs(wanted.q[i] - q[i]));
    control(q, dq, &wanted, tau);
    move(q, dq, tau);
  }
  printf("largest position error: %.2g rad or m\n", largest);
  return largest < LARGE ? 0 : 1;
}
