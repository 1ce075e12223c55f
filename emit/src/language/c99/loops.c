/* Newton's method on the loops: each step must be at most a quarter of the previous one. Where that fails, the motion from the
 * known pose is divided into shorter strides, which keeps the assembly mode (Deuflhard 2004, sections 2.1 and 5.1). */
typedef struct {
    int steps, contracts;
    double enough;
} NAME_rule;

static int NAME_newton(const NAME_model *self, const double *q, double *passive, NAME_rule rule, double *contraction)
{
    const double tiny = sqrt(DBL_EPSILON);
    double pose[UPPER_N_ACTIVE + UPPER_N_PASSIVE], scales[2 * UPPER_N_PASSIVE + UPPER_N_ACTIVE];
    double found[UPPER_N_PASSIVE + UPPER_N_PASSIVE * UPPER_N_PASSIVE], longest = 0.5, first = 0.0;
    int k, i;
    *contraction = 0.0;
    for (i = 0; i < UPPER_N_ACTIVE; i++)
        pose[i] = q[i];
    for (k = 0; k < rule.steps; k++) {
        double turns = 1.0, size = 0.0, cut = 1.0;
        int closed = 1, status;
        for (i = 0; i < UPPER_N_PASSIVE; i++)
            pose[UPPER_N_ACTIVE + i] = passive[i];
        (void)NAME_scales_program(self, pose, scales);
        (void)NAME_gaps_program(self, pose, found);
        for (i = 0; i < UPPER_N_ACTIVE; i++) {
            double scale = scales[2 * UPPER_N_PASSIVE + i];
            if (scale > 0.0 && fabs(q[i]) > turns * scale)
                turns = fabs(q[i]) / scale;
        }
        for (i = 0; i < UPPER_N_PASSIVE; i++) {
            double scale = scales[UPPER_N_PASSIVE + i];
            if (scale > 0.0 && fabs(passive[i]) > turns * scale)
                turns = fabs(passive[i]) / scale;
        }
        for (i = 0; i < UPPER_N_PASSIVE; i++)
            closed &= fabs(found[i]) <= DBL_EPSILON * 64.0 * turns * scales[i];
        status = NAME_solve(found + UPPER_N_PASSIVE, found, UPPER_N_PASSIVE);
        if (status != UPPER_OK)
            return status;
        for (i = 0; i < UPPER_N_PASSIVE; i++) {
            double scale = scales[UPPER_N_PASSIVE + i];
            if (!(fabs(found[i]) <= DBL_MAX))
                return UPPER_SINGULAR;
            if (fabs(found[i]) > size * scale)
                size = fabs(found[i]) / scale;
        }
        if (k == 0)
            first = size;
        if (k == 1)
            *contraction = size / first;
        if (!rule.contracts && size > longest)
            cut = longest / size;
        /* The loops are closed, but the passive coordinates still change: the loops do not determine them. */
        if (cut * size > longest)
            return closed ? UPPER_SINGULAR : UPPER_OUT_OF_REACH;
        for (i = 0; i < UPPER_N_PASSIVE; i++)
            passive[i] -= cut * found[i];
        if ((closed && size <= tiny) || size < rule.enough)
            return UPPER_OK;
        if (rule.contracts)
            longest = 0.25 * size;
    }
    return UPPER_OUT_OF_REACH;
}

static int NAME_follow(const NAME_model *self, const double *from, const double *known, const double *to, double *passive)
{
    const NAME_rule last_rule = {12, 1, 0.0}, way_rule = {12, 1, 1e-3};
    double pose[UPPER_N_ACTIVE + UPPER_N_PASSIVE], scales[2 * UPPER_N_PASSIVE + UPPER_N_ACTIVE];
    double at[UPPER_N_PASSIVE], before[UPPER_N_PASSIVE], guess[UPPER_N_PASSIVE], q[UPPER_N_ACTIVE];
    double distance = 0.0, longest, done = 0.0, done_before = 0.0, stride, contraction;
    int i, has_before = 0, status;
    long k;
    for (i = 0; i < UPPER_N_ACTIVE; i++)
        pose[i] = from[i];
    for (i = 0; i < UPPER_N_PASSIVE; i++)
        pose[UPPER_N_ACTIVE + i] = at[i] = before[i] = known[i];
    (void)NAME_scales_program(self, pose, scales);
    for (i = 0; i < UPPER_N_ACTIVE; i++) {
        double way = fabs(to[i] - from[i]), scale = scales[2 * UPPER_N_PASSIVE + i];
        if (scale > 0.0 && way > distance * scale)
            distance = way / scale;
    }
    if (distance > 0.5 * 200000.0)
        return UPPER_OUT_OF_REACH;
    longest = distance > 0.5 ? 0.5 / distance : 1.0;
    stride = longest;
    for (k = 0; k < 200000L; k++) {
        double remains = 1.0 - done;
        int last = stride * 1.001 >= remains;
        double next = last ? 1.0 : done + stride, way = last ? remains : stride;
        for (i = 0; i < UPPER_N_ACTIVE; i++)
            q[i] = last ? to[i] : from[i] + next * (to[i] - from[i]);
        for (i = 0; i < UPPER_N_PASSIVE; i++) {
            guess[i] = at[i];
            if (has_before)
                guess[i] += way / (done - done_before) * (at[i] - before[i]);
        }
        status = NAME_newton(self, q, guess, last ? last_rule : way_rule, &contraction);
        if (status == UPPER_OK && last) {
            for (i = 0; i < UPPER_N_PASSIVE; i++)
                passive[i] = guess[i];
            return UPPER_OK;
        }
        if (status == UPPER_OK) {
            for (i = 0; i < UPPER_N_PASSIVE; i++) {
                before[i] = at[i];
                at[i] = guess[i];
            }
            has_before = 1;
            done_before = done;
            done = next;
            if (contraction < 0.0625)
                stride = 2.0 * stride < longest ? 2.0 * stride : longest;
        } else {
            stride = 0.5 * way;
            if (stride <= sqrt(DBL_EPSILON) * longest)
                return status;
        }
    }
    return UPPER_OUT_OF_REACH;
}

int NAME_passive_position(const NAME_model *self, const double *q, double *passive)
{
    double from[UPPER_N_ACTIVE], found[UPPER_N_PASSIVE];
    int i, status;
    if (self->input != UPPER_OK)
        return self->input;
    if (self->nominal_status != UPPER_OK)
        return self->nominal_status;
    if (!NAME_all_fine(q, UPPER_N_ACTIVE))
        return UPPER_NOT_FINITE;
    NAME_nominal_active(self, from);
    status = NAME_follow(self, from, self->nominal, q, found);
    for (i = 0; status == UPPER_OK && i < UPPER_N_PASSIVE; i++)
        passive[i] = found[i];
    return status;
}

int NAME_passive_position_near(const NAME_model *self, const double *q, double *passive)
{
    const NAME_rule rule = {12, 1, 0.0};
    double guess[UPPER_N_PASSIVE], contraction;
    int i;
    if (self->input != UPPER_OK)
        return self->input;
    if (self->nominal_status != UPPER_OK)
        return self->nominal_status;
    if (!NAME_all_fine(q, UPPER_N_ACTIVE))
        return UPPER_NOT_FINITE;
    for (i = 0; i < UPPER_N_PASSIVE; i++)
        guess[i] = passive[i];
    if (NAME_newton(self, q, guess, rule, &contraction) != UPPER_OK)
        return NAME_passive_position(self, q, passive);
    for (i = 0; i < UPPER_N_PASSIVE; i++)
        passive[i] = guess[i];
    return UPPER_OK;
}
