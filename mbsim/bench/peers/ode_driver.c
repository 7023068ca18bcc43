/* Steps a scene with the Open Dynamics Engine: reads it from standard input as numbers between
 * blanks, and writes doubles to standard output. Built and run by ode.py, which has the units: SI.
 *
 * Input: dt, steps a row, rows, sweeps of QuickStep (0: the direct solver), ERP, CFM,
 * gravity (3), mu, restitution, speed below which there is none, contacts of a pair, seconds it may
 * take, whether shapes of two bodies touch; number of bodies, of each mass (0: it keeps its
 * velocity), principal inertia (3), place (3), quaternion (4), velocity (3), spin (3); number of
 * meshes, of each its vertices and triangles, and these; number of shapes, of each its body (-1:
 * fixed), kind, 7 numbers: PLANE a b c d; SPHERE radius, place (3); BOX edges (3), place (3), turn
 * about y; CYLINDER radius, length (along z), place (3); MESH which, place (3); places are on the
 * body, or in the world where the shape is fixed; number of hinges, of each two bodies, a point on
 * its axis (3) and its direction (3), in the world at t = 0.
 *
 * Output: seconds of the loop, largest depth over all steps, rows written, then the rows, of each
 * body place (3), quaternion (4), velocity (3), spin (3).
 */
#include <ode/ode.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PLANE, SPHERE, BOX, CYLINDER, MESH };
enum { MOST = 64, PER_BODY = 13 };

static dWorldID world;
static dJointGroupID touching;
static dSurfaceParameters surface;
static int most_contacts, bodies_touch;
static double deepest;

static double number(void) {
    double value;
    if (scanf("%lf", &value) != 1) {
        fprintf(stderr, "the scene ends too soon\n");
        exit(2);
    }
    return value;
}

static void meet(void *unused, dGeomID i, dGeomID j) {
    dContact contacts[MOST];
    dBodyID a = dGeomGetBody(i), b = dGeomGetBody(j);
    (void)unused;
    if ((!a && !b) || (a && b && !bodies_touch)) return;
    int count = dCollide(i, j, most_contacts, &contacts[0].geom, sizeof(dContact));
    for (int k = 0; k < count; k++) {
        contacts[k].surface = surface;
        if (contacts[k].geom.depth > deepest) deepest = contacts[k].geom.depth;
        dJointAttach(dJointCreateContact(world, touching, &contacts[k]), a, b);
    }
}

/* Puts a shape on its body, or where it is fixed; x is its place and a turn about y. */
static void put(dGeomID shape, dBodyID body, const double *x, double turn) {
    dMatrix3 R;
    dRFromAxisAndAngle(R, 0, 1, 0, turn);
    if (!body) {
        dGeomSetPosition(shape, x[0], x[1], x[2]);
        dGeomSetRotation(shape, R);
        return;
    }
    dGeomSetBody(shape, body);
    if (x[0] == 0.0 && x[1] == 0.0 && x[2] == 0.0 && turn == 0.0) return;
    dGeomSetOffsetPosition(shape, x[0], x[1], x[2]);
    dGeomSetOffsetRotation(shape, R);
}

static double now(void) {
    struct timespec clock;
    clock_gettime(CLOCK_MONOTONIC, &clock);
    return clock.tv_sec + 1e-9 * clock.tv_nsec;
}

static void store(double *row, dBodyID *bodies, int count) {
    for (int b = 0; b < count; b++, row += PER_BODY) {
        const dReal *p = dBodyGetPosition(bodies[b]), *q = dBodyGetQuaternion(bodies[b]);
        const dReal *v = dBodyGetLinearVel(bodies[b]), *w = dBodyGetAngularVel(bodies[b]);
        for (int k = 0; k < 3; k++) row[k] = p[k], row[7 + k] = v[k], row[10 + k] = w[k];
        for (int k = 0; k < 4; k++) row[3 + k] = q[k];
    }
}

int main(void) {
    dInitODE2(0);
    dAllocateODEDataForThread(dAllocateMaskAll);
    double dt = number();
    int every = (int)number(), rows = (int)number(), sweeps = (int)number();
    world = dWorldCreate();
    dSpaceID space = dHashSpaceCreate(0);
    touching = dJointGroupCreate(0);
    dWorldSetERP(world, number());
    dWorldSetCFM(world, number());
    double gx = number(), gy = number(), gz = number();
    dWorldSetGravity(world, gx, gy, gz);
    if (sweeps > 0) dWorldSetQuickStepNumIterations(world, sweeps);
    surface.mode = dContactApprox1;
    surface.mu = number();
    surface.bounce = number();
    surface.bounce_vel = number();
    if (surface.bounce > 0.0) surface.mode |= dContactBounce;
    most_contacts = (int)number();
    if (most_contacts > MOST) most_contacts = MOST;
    double cap = number();
    bodies_touch = (int)number();

    int count = (int)number();
    dBodyID *bodies = malloc(sizeof(dBodyID) * (count + 1));
    for (int b = 0; b < count; b++) {
        double x[17];
        for (int k = 0; k < 17; k++) x[k] = number();
        dMass mass;
        bodies[b] = dBodyCreate(world);
        dQuaternion q = {x[7], x[8], x[9], x[10]};
        if (x[0] > 0.0) {
            dMassSetParameters(&mass, x[0], 0, 0, 0, x[1], x[2], x[3], 0, 0, 0);
            dBodySetMass(bodies[b], &mass);
        } else dBodySetKinematic(bodies[b]);
        dBodySetPosition(bodies[b], x[4], x[5], x[6]);
        dBodySetQuaternion(bodies[b], q);
        dBodySetLinearVel(bodies[b], x[11], x[12], x[13]);
        dBodySetAngularVel(bodies[b], x[14], x[15], x[16]);
    }
    int meshes = (int)number();
    dTriMeshDataID *data = malloc(sizeof(dTriMeshDataID) * (meshes + 1));
    for (int m = 0; m < meshes; m++) {
        int vertices = (int)number(), triangles = (int)number();
        double *place = malloc(sizeof(double) * 3 * vertices);
        dTriIndex *corner = malloc(sizeof(dTriIndex) * 3 * triangles);
        for (int k = 0; k < 3 * vertices; k++) place[k] = number();
        for (int k = 0; k < 3 * triangles; k++) corner[k] = (dTriIndex)number();
        data[m] = dGeomTriMeshDataCreate();
        dGeomTriMeshDataBuildDouble(data[m], place, 3 * sizeof(double), vertices, corner,
                                    3 * triangles, 3 * sizeof(dTriIndex));
    }
    int shapes = (int)number();
    for (int s = 0; s < shapes; s++) {
        int body = (int)number(), kind = (int)number();
        double x[7];
        for (int k = 0; k < 7; k++) x[k] = number();
        dBodyID on = body >= 0 ? bodies[body] : 0;
        if (kind == PLANE) dCreatePlane(space, x[0], x[1], x[2], x[3]);
        else if (kind == SPHERE) put(dCreateSphere(space, x[0]), on, x + 1, 0.0);
        else if (kind == BOX) put(dCreateBox(space, x[0], x[1], x[2]), on, x + 3, x[6]);
        else if (kind == CYLINDER) put(dCreateCylinder(space, x[0], x[1]), on, x + 2, 0.0);
        else put(dCreateTriMesh(space, data[(int)x[0]], 0, 0, 0), on, x + 1, 0.0);
    }
    int hinges = (int)number();
    for (int h = 0; h < hinges; h++) {
        int a = (int)number(), b = (int)number();
        double x[6];
        for (int k = 0; k < 6; k++) x[k] = number();
        dJointID hinge = dJointCreateHinge(world, 0);
        dJointAttach(hinge, a >= 0 ? bodies[a] : 0, b >= 0 ? bodies[b] : 0);
        dJointSetHingeAnchor(hinge, x[0], x[1], x[2]);
        dJointSetHingeAxis(hinge, x[3], x[4], x[5]);
    }

    double *stored = calloc((size_t)(rows + 1) * count * PER_BODY, sizeof(double));
    store(stored, bodies, count);
    int done = 1;
    double begun = now();
    for (; done <= rows; done++) {
        for (int k = 0; k < every; k++) {
            dSpaceCollide(space, 0, meet);
            if (sweeps > 0) dWorldQuickStep(world, dt);
            else dWorldStep(world, dt);
            dJointGroupEmpty(touching);
        }
        store(stored + (size_t)done * count * PER_BODY, bodies, count);
        if (now() - begun > cap) {
            done++;
            break;
        }
    }
    double head[3] = {now() - begun, deepest, done};
    fwrite(head, sizeof(double), 3, stdout);
    fwrite(stored, sizeof(double), (size_t)done * count * PER_BODY, stdout);
    return 0;
}
