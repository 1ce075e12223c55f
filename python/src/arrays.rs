//! Access to arrays of numpy without copying: numbers and their order go to the library, state by state or column by
//! column.

use modelmill::states::StateMatrix;
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::input_error;

/// The numbers of an array of shape (states, columns), in C or Fortran order.
pub(crate) fn state_matrix<'a>(py: Python<'_>, array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<StateMatrix<'a>> {
    let by_state = array.is_c_contiguous();
    let width = array.shape()[1];
    match array.as_slice() {
        Ok(numbers) if by_state || array.is_fortran_contiguous() => Ok(StateMatrix {
            numbers,
            width,
            by_state,
        }),
        _ => Err(input_error(
            py,
            "an array is contiguous in memory neither by rows nor by columns; pass a copy, such as numpy.ascontiguousarray(x)",
        )),
    }
}
