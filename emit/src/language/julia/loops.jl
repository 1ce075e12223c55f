# Adds the solution of the loops at the nominal pose.
function finish_preparation(geometry, base, once, scale)
    nominal = nominal_passive(scale)
    start = Dynamics(geometry, copy(base), once, scale, nominal, OK)
    status, _ = newton!(nominal, start, nominal_active(scale), 50, false, 0.0)
    return Dynamics(geometry, copy(base), once, scale, nominal, status)
end

# Newton's method on the loops: each step must be at most a quarter of the previous one. Where that fails, the motion
# from the known pose is divided into shorter strides, which keeps the assembly mode (Deuflhard 2004, sections 2.1 and
# 5.1). Returns the status and the ratio of the first two steps.
function newton!(passive, dynamics, q, steps, contracts, enough)
    scales = zeros(2 * N_PASSIVE + N_ACTIVE)
    found = zeros(N_PASSIVE + N_PASSIVE * N_PASSIVE)
    longest = 0.5
    before = 0.0
    contraction = 0.0
    for k in 1:steps
        pose = vcat(q, passive)
        scales_program!(scales, dynamics, pose)
        gaps_program!(found, dynamics, pose)
        turns = 1.0
        for i in 1:N_ACTIVE
            scale = scales[2*N_PASSIVE+i]
            if scale > 0.0 && abs(q[i]) > turns * scale
                turns = abs(q[i]) / scale
            end
        end
        for i in 1:N_PASSIVE
            scale = scales[N_PASSIVE+i]
            if scale > 0.0 && abs(passive[i]) > turns * scale
                turns = abs(passive[i]) / scale
            end
        end
        closed = true
        for i in 1:N_PASSIVE
            closed = closed && abs(found[i]) <= eps() * 64.0 * turns * scales[i]
        end
        step = found[1:N_PASSIVE]
        status = solve!(matrix(found, N_PASSIVE, N_PASSIVE, N_PASSIVE), step)
        status == OK || return (status, contraction)
        largest = 0.0
        for i in 1:N_PASSIVE
            scale = scales[N_PASSIVE+i]
            isfinite(step[i]) || return (SINGULAR, contraction)
            if abs(step[i]) > largest * scale
                largest = abs(step[i]) / scale
            end
        end
        if k == 1
            before = largest
        elseif k == 2
            contraction = largest / before
        end
        cut = !contracts && largest > longest ? longest / largest : 1.0
        # The loops are closed, but the passive coordinates still change: the loops do not determine them.
        if cut * largest > longest
            return (closed ? SINGULAR : OUT_OF_REACH, contraction)
        end
        for i in 1:N_PASSIVE
            passive[i] -= cut * step[i]
        end
        if (closed && largest <= sqrt(eps())) || largest < enough
            return (OK, contraction)
        end
        if contracts
            longest = 0.25 * largest
        end
    end
    return (OUT_OF_REACH, contraction)
end

# Follows the passive coordinates from a pose where they are known to another one. Returns the status and their values.
function follow(dynamics, from, known, to)
    scales = zeros(2 * N_PASSIVE + N_ACTIVE)
    scales_program!(scales, dynamics, vcat(from, known))
    distance = 0.0
    for i in 1:N_ACTIVE
        way = abs(to[i] - from[i])
        scale = scales[2*N_PASSIVE+i]
        if scale > 0.0 && way > distance * scale
            distance = way / scale
        end
    end
    distance > 0.5 * 200000.0 && return (OUT_OF_REACH, known)
    longest = distance > 0.5 ? 0.5 / distance : 1.0
    stride = longest
    at = copy(known)
    previous = copy(known)
    has_previous = false
    done = 0.0
    done_before = 0.0
    for k in 1:200000
        remains = 1.0 - done
        is_last = stride * 1.001 >= remains
        next = is_last ? 1.0 : done + stride
        way = is_last ? remains : stride
        q = copy(to)
        guess = copy(at)
        for i in 1:N_ACTIVE
            if !is_last
                q[i] = from[i] + next * (to[i] - from[i])
            end
        end
        for i in 1:N_PASSIVE
            if has_previous
                guess[i] += way / (done - done_before) * (at[i] - previous[i])
            end
        end
        status, contraction = newton!(guess, dynamics, q, 12, true, is_last ? 0.0 : 1e-3)
        if status == OK && is_last
            return (OK, guess)
        end
        if status == OK
            previous = at
            at = guess
            has_previous = true
            done_before = done
            done = next
            if contraction < 0.0625
                stride = min(2.0 * stride, longest)
            end
        else
            stride = 0.5 * way
            stride <= sqrt(eps()) * longest && return (status, known)
        end
    end
    return (OUT_OF_REACH, known)
end

"""
Passive coordinates of a pose, in the assembly mode of the nominal pose, followed from there. With `near`, the passive
coordinates of a nearby pose, they are found from those, and `near` is replaced.
"""
function passive_position(dynamics, q, near = nothing)
    check_length(q, N_ACTIVE)
    check_fine(q)
    if near !== nothing
        check_length(near, N_PASSIVE)
        guess = copy(near)
        status, _ = newton!(guess, dynamics, q, 12, true, 0.0)
        if status != OK
            guess = passive_position(dynamics, q)
        end
        for i in 1:N_PASSIVE
            near[i] = guess[i]
        end
        return guess
    end
    check(dynamics.nominal_status)
    status, found = follow(dynamics, nominal_active(dynamics.scale), dynamics.nominal, q)
    check(status)
    return found
end
