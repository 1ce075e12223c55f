"Forward dynamics: accelerations under given forces of the drives. Accelerations of the state are not read."
function forward(dynamics, STATE, forcesNEAR_DEFAULT)
    check_length(forces, N_DRIVES)
    check_fine(forces)
    mass = mass_matrix(dynamics, STATENEAR_MATRIX)
    terms = bias_and_drives(dynamics, STATENEAR_BIAS)
    accelerations = zeros(N_ACTIVE)
    for i in 1:N_ACTIVE
        accelerations[i] = -terms.bias[i]
        for d in 1:N_DRIVES
            accelerations[i] += terms.jacobian[d, i] * forces[d]
        end
    end
    check(solve!(mass, accelerations))
    for value in accelerations
        isfinite(value) || throw(ModelError(SINGULAR))
    end
    return accelerations
end
