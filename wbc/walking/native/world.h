/* What stands around: a surface and obstacles; how far segments are from them, as planner/around.py. */
#ifndef WBC_WALKING_WORLD_H
#define WBC_WALKING_WORLD_H

#include "near.h"
#include "surface.h"

enum { ROUND, BOX, DRUM, MESH };
/* No thing; segments are halved until they are this short [m] */
enum { NOTHING = -1 };
static const double SHORT = 2e-4;

/* A capsule (radius, half of its length), a box (halves), a cylinder (radius, half of its length), or a closed surface
   of triangles, the first of the world's that are its own, in a tree of boxes from `root` on. `middle` and `reach`: a
   ball about it. */
typedef struct {
    long kind, root;
    double turn[9], origin[3], size[3], middle[3], reach;
} Thing;

/* `surface` may be none; `nodes`: two children, or -1 - first and -1 - last of the triangles, and a box (6) each;
   triangles 9 each. `body`: segments of the body and of what stands still on it, two ends and a radius; `own` (arms x
   bodies x 7) the same in the frames of the arms' bases, with a radius below 0 where another check looks. `mounted` (holds x
   (things + 1)): whether a hold is on a thing; the surface is the last one. Distances that are required: of the body, of
   the links of an arm from obstacles and from the surface, the last one the hand's, which is `near_hold` from a hold
   when it may be as near to what that is mounted on as that its core is `deep` in it; of links from the body and each
   other, radii aside. */
typedef struct {
    const Surface *surface;
    long things, bodies, holds;
    const Thing *thing;
    const long *children;
    const double *boxes, *triangles, *body, *own, *places;
    const unsigned char *mounted;
    double radii[LINKS], from_things[LINKS], from_surface[LINKS], of_body, near_hold, deep, from_own;
} World;

static double square_from_box(const double *p, const double *box)
{
    double out = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double off = larger(0.0, larger(box[k] - p[k], p[k] - box[3 + k]));
        out += off * off;
    }
    return out;
}

/* Square of the distance of a point from a triangle (Ericson, Real-time collision detection, 5.1.5). */
static double square_from_triangle(const double *p, const double *t)
{
    const double *a = t, *b = t + 3, *c = t + 6;
    double ab[3], ac[3], ap[3], bp[3], cp[3], at[3], v = 0.0, w = 0.0;
    for (int k = 0; k < 3; ++k) {
        ab[k] = b[k] - a[k], ac[k] = c[k] - a[k];
        ap[k] = p[k] - a[k], bp[k] = p[k] - b[k], cp[k] = p[k] - c[k];
    }
    const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp);
    const double d6 = dot(ac, cp), va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (d1 <= 0.0 && d2 <= 0.0) {
    } else if (d3 >= 0.0 && d4 <= d3)
        v = 1.0;
    else if (d6 >= 0.0 && d5 <= d6)
        w = 1.0;
    else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0)
        v = d1 - d3 > 0.0 ? d1 / (d1 - d3) : 0.0;
    else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0)
        w = d2 - d6 > 0.0 ? d2 / (d2 - d6) : 0.0;
    else if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
        w = d4 - d3 + d5 - d6 > 0.0 ? (d4 - d3) / (d4 - d3 + d5 - d6) : 0.0;
        v = 1.0 - w;
    } else {
        v = vb / (va + vb + vc);
        w = vc / (va + vb + vc);
    }
    for (int k = 0; k < 3; ++k)
        at[k] = ap[k] - v * ab[k] - w * ac[k];
    return dot(at, at);
}

/* Whether a point is within a closed surface: how often a line from it goes through. */
static int enclosed(const World *world, const Thing *thing, const double *p)
{
    /* No edge of a real body runs this way */
    static const double WAY[3] = { 0.8017837257372732, 0.5345224838248488, 0.2672612419124244 };
    long stack[128], top = 0, count = 0;
    if (square_from_box(p, world->boxes + 6 * thing->root) > 0.0)
        return 0;
    stack[top++] = thing->root;
    while (top) {
        const long node = stack[--top], *child = world->children + 2 * node;
        const double *box = world->boxes + 6 * node;
        double enter = 0.0, leave = INFINITY;
        for (int k = 0; k < 3; ++k) {
            enter = larger(enter, (box[k] - p[k]) / WAY[k]);
            leave = smaller(leave, (box[3 + k] - p[k]) / WAY[k]);
        }
        if (enter > leave)
            continue;
        if (child[0] >= 0) {
            stack[top++] = child[0];
            stack[top++] = child[1];
            continue;
        }
        for (long f = -1 - child[0]; f <= -1 - child[1]; ++f) {
            const double *t = world->triangles + 9 * f;
            double e1[3], e2[3], from[3];
            for (int k = 0; k < 3; ++k)
                e1[k] = t[3 + k] - t[k], e2[k] = t[6 + k] - t[k], from[k] = p[k] - t[k];
            const double n[3] = { WAY[1] * e2[2] - WAY[2] * e2[1], WAY[2] * e2[0] - WAY[0] * e2[2],
                                  WAY[0] * e2[1] - WAY[1] * e2[0] };
            const double det = dot(e1, n), u = dot(from, n);
            const double m[3] = { from[1] * e1[2] - from[2] * e1[1], from[2] * e1[0] - from[0] * e1[2],
                                  from[0] * e1[1] - from[1] * e1[0] };
            const double v = dot(WAY, m), far = dot(e2, m), sign = det < 0.0 ? -1.0 : 1.0;
            count += det != 0.0 && sign * u >= 0.0 && sign * v >= 0.0 && sign * (u + v) <= sign * det
                     && sign * far > 0.0;
        }
    }
    return count & 1;
}

/* Distance of a point, in its frame, from a closed surface, at most `most`; negative within. */
static double from_mesh(const World *world, const Thing *thing, const double *p, double most)
{
    long stack[128], top = 0;
    double best = most * most;
    stack[top++] = thing->root;
    while (top) {
        const long node = stack[--top], *child = world->children + 2 * node;
        if (square_from_box(p, world->boxes + 6 * node) >= best)
            continue;
        if (child[0] >= 0) {
            const double one = square_from_box(p, world->boxes + 6 * child[0]);
            const int swap = one < square_from_box(p, world->boxes + 6 * child[1]);
            stack[top++] = child[swap ? 1 : 0];
            stack[top++] = child[swap ? 0 : 1];
            continue;
        }
        for (long f = -1 - child[0]; f <= -1 - child[1]; ++f)
            best = smaller(best, square_from_triangle(p, world->triangles + 9 * f));
    }
    return enclosed(world, thing, p) ? -sqrt(best) : sqrt(best);
}

/* Signed distance of a point from a thing; what is farther than `most` may be given as any distance beyond it. */
static double from_thing(const World *world, const Thing *thing, const double *point, double most)
{
    double p[3], off[3], square = 0.0, inner = -INFINITY;
    for (int k = 0; k < 3; ++k)
        off[k] = point[k] - thing->origin[k];
    for (int k = 0; k < 3; ++k)
        p[k] = thing->turn[k] * off[0] + thing->turn[3 + k] * off[1] + thing->turn[6 + k] * off[2];
    if (thing->kind == MESH)
        return from_mesh(world, thing, p, most);
    if (thing->kind == ROUND) {
        p[2] -= smaller(larger(p[2], -thing->size[1]), thing->size[1]);
        return sqrt(dot(p, p)) - thing->size[0];
    }
    double beyond[3] = { fabs(p[0]) - thing->size[0], fabs(p[1]) - thing->size[1], fabs(p[2]) - thing->size[2] };
    if (thing->kind == DRUM) {
        beyond[0] = beyond[1] = hypot(p[0], p[1]) - thing->size[0];
        beyond[2] = fabs(p[2]) - thing->size[1];
    }
    for (int k = thing->kind == DRUM; k < 3; ++k) {
        square += beyond[k] > 0.0 ? beyond[k] * beyond[k] : 0.0;
        inner = larger(inner, beyond[k]);
    }
    return inner < 0.0 ? inner : sqrt(square);
}

/* Whether a segment is at least `least` from a thing, within SHORT: where its middle is far enough, all of it is. */
static int apart(const World *world, const Thing *thing, const double *a, const double *b, double least)
{
    double middle[3], span[3], ball[3];
    for (int k = 0; k < 3; ++k) {
        middle[k] = 0.5 * (a[k] + b[k]);
        span[k] = b[k] - a[k];
        ball[k] = middle[k] - thing->middle[k];
    }
    const double half = 0.5 * sqrt(dot(span, span)), reach = thing->reach + half + least;
    if (dot(ball, ball) >= reach * reach)
        return 1;
    if (thing->kind == ROUND) {
        double ends[2][3];
        for (int k = 0; k < 3; ++k) {
            ends[0][k] = thing->origin[k] - thing->size[1] * thing->turn[3 * k + 2];
            ends[1][k] = thing->origin[k] + thing->size[1] * thing->turn[3 * k + 2];
        }
        const double far = least + thing->size[0];
        return far <= 0.0 || segment_square(a, b, ends[0], ends[1]) >= far * far;
    }
    const double gap = from_thing(world, thing, middle, half + larger(fabs(least), 1e-3));
    if (gap >= least + half)
        return 1;
    if (gap < least)
        return 0;
    if (half < SHORT)
        return 1;
    return apart(world, thing, a, middle, least) && apart(world, thing, middle, b, least);
}

/* Least height of a segment above a surface is `least` at least: over a cylinder a chord may be lower than its ends. */
static int over(const Surface *surface, const double *a, const double *b, double least)
{
    if (surface->radius <= 0.0)
        return above(surface, a) >= least && above(surface, b) >= least;
    double from[3], span[3], square = 0.0, along = 0.0, length = 0.0, part;
    across(surface, a, from);
    across(surface, b, span);
    for (int k = 0; k < 3; ++k) {
        span[k] -= from[k];
        along -= from[k] * span[k];
        length += span[k] * span[k];
    }
    part = along <= 0.0 ? 0.0 : along >= length ? 1.0 : along / length;
    for (int k = 0; k < 3; ++k)
        square += (from[k] + part * span[k]) * (from[k] + part * span[k]);
    const double far = least + surface->radius;
    return far <= 0.0 || square >= far * far;
}

/* Distance of a point from all that stands around. */
static double clearance_at(const World *world, const double *p)
{
    double out = world->surface ? above(world->surface, p) : INFINITY;
    for (long k = 0; k < world->things; ++k) {
        const Thing *thing = world->thing + k;
        double ball[3];
        for (int i = 0; i < 3; ++i)
            ball[i] = p[i] - thing->middle[i];
        if (sqrt(dot(ball, ball)) - thing->reach < out)
            out = smaller(out, from_thing(world, thing, p, larger(out, 1e-3)));
    }
    return out;
}

/* The first thing that the body at a pose is nearer to than it may be, and `more`, `things` for the surface; NOTHING for
   none. */
static long body_meets(const World *world, const Frame *pose, double more)
{
    for (long s = 0; s < world->bodies; ++s) {
        const double *segment = world->body + 7 * s, least = segment[6] + world->of_body + more;
        double ends[2][3];
        for (int e = 0; e < 2; ++e)
            for (int k = 0; k < 3; ++k)
                ends[e][k] = dot(pose->row[k], segment + 3 * e) + pose->row[k][3];
        for (long k = 0; k < world->things; ++k)
            if (!apart(world, world->thing + k, ends[0], ends[1], least))
                return k;
        if (world->surface && !over(world->surface, ends[0], ends[1], least))
            return world->things;
    }
    return NOTHING;
}

/* The first thing that a link of an arm is nearer to than it may be, and `more`; `things` for the surface, NOTHING for
   none. `points` in the world; `holds`: rows of the holds that its hand leaves and comes to, or -1. */
static long arm_meets(const World *world, const double (*points)[3], const long *holds, double more)
{
    const unsigned char *mounted[2] = { 0, 0 };
    int touching[2] = { 0, 0 };
    for (int end = 0; end < 2; ++end)
        if (holds[end] >= 0) {
            double gap[3];
            for (int k = 0; k < 3; ++k)
                gap[k] = points[POINTS - 1][k] - world->places[3 * holds[end] + k];
            mounted[end] = world->mounted + holds[end] * (world->things + 1);
            touching[end] = dot(gap, gap) <= world->near_hold * world->near_hold;
        }
    for (int link = 1; link < LINKS; ++link) {
        const double *a = points[BEGINS[link]], *b = points[ENDS[link]];
        for (long k = 0; k <= world->things; ++k) {
            const int surface = k == world->things;
            double least = (surface ? world->from_surface : world->from_things)[link] + more;
            if (surface && !world->surface)
                continue;
            for (int end = 0; end < 2 && link == LINKS - 1; ++end)
                if (mounted[end] && mounted[end][k])
                    /* The hand comes as near to what its hold is on as it may */
                    least = smaller(least, touching[end] ? -world->deep : world->from_surface[link] + more);
            if (surface ? !over(world->surface, a, b, least) : !apart(world, world->thing + k, a, b, least))
                return k;
        }
    }
    return NOTHING;
}

/* Whether forearm or hand are nearer to the body or the arm's own neck than they may be, and `more`, or the hand to the
   upper arm; points in the frame of the arm's base. */
static int meets_itself(const World *world, long row, const double (*points)[3], double more)
{
    const double least = world->from_own + more;
    for (int link = 2; link < LINKS; ++link) {
        const double *a = points[BEGINS[link]], *b = points[ENDS[link]];
        for (long s = 0; s < world->bodies; ++s) {
            const double *segment = world->own + 7 * (world->bodies * row + s);
            const double far = least + world->radii[link] + segment[6];
            if (segment[6] >= 0.0 && segment_square(a, b, segment, segment + 3) < far * far)
                return 1;
        }
    }
    const double far = least + world->radii[1] + world->radii[3];
    return segment_square(points[2], points[3], points[4], points[5]) < far * far;
}

static void carried(const Frame *frame, const double (*points)[3], double (*out)[3])
{
    for (int p = 0; p < POINTS; ++p)
        for (int k = 0; k < 3; ++k)
            out[p][k] = dot(frame->row[k], points[p]) + frame->row[k][3];
}

/* What arm `row` meets with its base at a frame; `things` + 1 for the body and itself, NOTHING for none. */
static long posture_meets(const World *world, const Arm *arm, long row, const Frame *frame, const double *q,
                          const long *holds)
{
    static const Frame HERE = { { { 1.0, 0.0, 0.0, 0.0 }, { 0.0, 1.0, 0.0, 0.0 }, { 0.0, 0.0, 1.0, 0.0 } } };
    double local[POINTS][3], placed[POINTS][3];
    arm_points(arm, &HERE, q, local);
    if (meets_itself(world, row, (const double (*)[3])local, 0.0))
        return world->things + 1;
    carried(frame, (const double (*)[3])local, placed);
    return arm_meets(world, (const double (*)[3])placed, holds, 0.0);
}

/* The points of an arm at an instant: in the frame of its base, and in the world. */
typedef struct {
    double local[POINTS][3], placed[POINTS][3];
} Place;

/* Way [m] between two instants over which a straight line of points stands for what is between */
static const double FINELY = 2.5e-3;

/* Whether an arm is clear between two instants, its points going straight from the one to the other: where the middle is
   farther from everything than any point goes, all of it is. */
static int between_clear(const World *world, long row, const Place *one, const Place *other, const long *holds)
{
    Place middle;
    double most = 0.0;
    for (int p = 2; p < POINTS; ++p) {
        double way[3];
        for (int k = 0; k < 3; ++k) {
            way[k] = 0.5 * (other->placed[p][k] - one->placed[p][k]);
            middle.placed[p][k] = one->placed[p][k] + way[k];
            middle.local[p][k] = 0.5 * (other->local[p][k] + one->local[p][k]);
        }
        most = larger(most, dot(way, way));
    }
    const double way = sqrt(most);
    const double (*placed)[3] = (const double (*)[3])middle.placed, (*local)[3] = (const double (*)[3])middle.local;
    if (arm_meets(world, placed, holds, way) == NOTHING && !meets_itself(world, row, local, way))
        return 1;
    if (arm_meets(world, placed, holds, 0.0) != NOTHING || meets_itself(world, row, local, 0.0))
        return 0;
    return way < FINELY
           || (between_clear(world, row, one, &middle, holds) && between_clear(world, row, &middle, other, holds));
}

/* What the body is nearer to at n poses (4 x 4) than it may be, and `more`: `things` for the surface, NOTHING for none. */
void bodies_meet(const World *world, double more, long n, const double *poses, long *out)
{
    for (long i = 0; i < n; ++i) {
        const Frame pose = frame_of(poses + 16 * i);
        out[i] = body_meets(world, &pose, more);
    }
}

/* What arm `row` meets at n frames of its base (4 x 4) with six angles each, `holds` n x 2; `things` + 1: the body. */
void postures_meet(const World *world, const Arm *arm, long row, long n, const double *frames, const double *q,
                   const long *holds, long *out)
{
    for (long i = 0; i < n; ++i) {
        const Frame frame = frame_of(frames + 16 * i);
        out[i] = posture_meets(world, arm, row, &frame, q + JOINTS * i, holds + 2 * i);
    }
}

/* Whether m swings of arms `rows`, at n points each, are clear: `points` m x n x 6 x 3 in the frame of the body, `bases`
   (4 x 4) of the arms in it, `bodies` m x n x 4 x 4, `holds` m x 2. */
void swings_meet(const World *world, long m, long n, const long *rows, const double *points, const double *bases,
                 const double *bodies, const long *holds, unsigned char *out)
{
    for (long s = 0; s < m; ++s) {
        Place place[2];
        const double *base = bases + 16 * s;
        out[s] = 1;
        for (long i = 0; i < n && out[s]; ++i) {
            const Frame body = frame_of(bodies + 16 * (s * n + i));
            const double (*given)[3] = (const double (*)[3])(points + 3 * POINTS * (s * n + i));
            Place *here = place + (i & 1);
            for (int p = 0; p < POINTS; ++p) {
                const double off[3] = { given[p][0] - base[3], given[p][1] - base[7], given[p][2] - base[11] };
                for (int k = 0; k < 3; ++k)
                    here->local[p][k] = base[k] * off[0] + base[4 + k] * off[1] + base[8 + k] * off[2];
            }
            carried(&body, given, here->placed);
            out[s] = arm_meets(world, (const double (*)[3])here->placed, holds + 2 * s, 0.0) == NOTHING
                     && !meets_itself(world, rows[s], (const double (*)[3])here->local, 0.0)
                     && (!i || between_clear(world, rows[s], place + ((i + 1) & 1), here, holds + 2 * s));
        }
    }
}

/* Distances of n points from all that stands around. */
void heights(const World *world, long n, const double *points, double *out)
{
    for (long i = 0; i < n; ++i)
        out[i] = clearance_at(world, points + 3 * i);
}

/* Which holds are within `most` of the surface of what: holds x (things + 1). */
void holds_on(const World *world, double most, unsigned char *out)
{
    for (long h = 0; h < world->holds; ++h) {
        const double *at = world->places + 3 * h;
        for (long k = 0; k < world->things; ++k)
            *out++ = (unsigned char)(fabs(from_thing(world, world->thing + k, at, 2.0 * most)) <= most);
        *out++ = (unsigned char)(world->surface && fabs(above(world->surface, at)) <= most);
    }
}

#endif
