const OK = 0
const OUT_OF_REACH = 1
const SINGULAR = 2
const UNDEFINED = 3
const NOT_FINITE = 4
const SPECIAL = 5
const MESSAGES = [
    "the loops cannot close: the pose is out of reach",
    "the pose is singular",
    "a term of the model has no finite value at this state",
    "an input is NaN, infinite, or above 1e60",
    "a denominator of the base parameters is zero for this geometry",
]

# A determinant below this share of the magnitude of its terms is singular; an input above this limit is refused.
const SINGULAR_SHARE = 1e-9
const LARGEST_INPUT = 1e60

"A state, geometry or set of parameters for which the model has no value; `status` is one of the constants above."
struct ModelError <: Exception
    status::Int
end

function Base.showerror(io::IO, fault::ModelError)
    print(io, MESSAGES[fault.status])
end

# Throws an error unless the status is `OK`.
function check(status)
    status == OK || throw(ModelError(status))
    return nothing
end

# Whether all numbers are finite and below the limit for inputs.
function all_fine(values)
    for value in values
        abs(value) < LARGEST_INPUT || return false
    end
    return true
end

# Refuses numbers that are not fine.
function check_fine(values)
    all_fine(values) || throw(ModelError(NOT_FINITE))
    return nothing
end

# Refuses a divisor of the base parameters that is small relative to its terms.
function check_divisor(value, size)
    abs(value) > SINGULAR_SHARE * size || throw(ModelError(SPECIAL))
    return nothing
end

# Refuses an array of the wrong length.
function check_length(values, n)
    length(values) == n || throw(DimensionMismatch("an array of the model has another length"))
    return nothing
end

# The matrix whose rows follow each other in an array, after the first `offset` numbers.
function matrix(values, offset, n_rows, n_columns)
    return permutedims(reshape(values[offset+1:offset+n_rows*n_columns], n_columns, n_rows))
end
