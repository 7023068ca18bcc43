/* Steps a scene with the Open Dynamics Engine: reads it from standard input as numbers between
 * blanks, and writes doubles to standard output. Built and run by ode.py, which has the units: SI.
 *
 * Input: dt, steps a row, rows, sweeps of QuickStep (0: the direct solver), ERP, CFM,
 * gravity (3), mu, restitution, speed below which there is none, contacts of a pair, seconds it may
 * take; number of bodies, of each mass, principal inertia (3), place (3), quaternion (4), velocity
 * (3), spin (3); number of meshes, of each its vertices and triangles, and these; number of shapes,
 * of each its body (-1: fixed), kind, 7 numbers: PLANE a b c d; SPHERE radius; BOX edges (3);
 * CYLINDER radius, length (along z); MESH which, place (3) of a fixed one.
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
static int most_contacts;
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
    if (!a && !b) return;
    int count = dCollide(i, j, most_contacts, &contacts[0].geom, sizeof(dContact));
    for (int k = 0; k < count; k++) {
        contacts[k].surface = surface;
        if (contacts[k].geom.depth > deepest) deepest = contacts[k].geom.depth;
        dJointAttach(dJointCreateContact(world, touching, &contacts[k]), a, b);
    }
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

    int count = (int)number();
    dBodyID *bodies = malloc(sizeof(dBodyID) * (count + 1));
    for (int b = 0; b < count; b++) {
        double x[17];
        for (int k = 0; k < 17; k++) x[k] = number();
        dMass mass;
        dMassSetParameters(&mass, x[0], 0, 0, 0, x[1], x[2], x[3], 0, 0, 0);
        bodies[b] = dBodyCreate(world);
        dQuaternion q = {x[7], x[8], x[9], x[10]};
        dBodySetMass(bodies[b], &mass);
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
        dGeomID shape;
        if (kind == PLANE) shape = dCreatePlane(space, x[0], x[1], x[2], x[3]);
        else if (kind == SPHERE) shape = dCreateSphere(space, x[0]);
        else if (kind == BOX) shape = dCreateBox(space, x[0], x[1], x[2]);
        else if (kind == CYLINDER) shape = dCreateCylinder(space, x[0], x[1]);
        else shape = dCreateTriMesh(space, data[(int)x[0]], 0, 0, 0);
        if (body >= 0) dGeomSetBody(shape, bodies[body]);
        else if (kind == MESH) dGeomSetPosition(shape, x[1], x[2], x[3]);
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
