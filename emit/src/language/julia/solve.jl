# Solves a * x = rhs by Gaussian elimination with partial pivoting; rhs becomes x, the matrix is overwritten.
function solve!(a, rhs)
    n = length(rhs)
    for column in 1:n
        pivot = column
        largest = 0.0
        for row in column:n
            if abs(a[row, column]) > largest
                largest = abs(a[row, column])
                pivot = row
            end
        end
        largest > 0.0 || return SINGULAR
        if pivot != column
            rhs[column], rhs[pivot] = rhs[pivot], rhs[column]
            for k in 1:n
                a[column, k], a[pivot, k] = a[pivot, k], a[column, k]
            end
        end
        for row in column+1:n
            factor = a[row, column] / a[column, column]
            for k in column+1:n
                a[row, k] -= factor * a[column, k]
            end
            rhs[row] -= factor * rhs[column]
        end
    end
    for row in n:-1:1
        for k in row+1:n
            rhs[row] -= a[row, k] * rhs[k]
        end
        rhs[row] /= a[row, row]
    end
    return OK
end
