//! Blocks on all cores: states are halved until a part is small enough, and the parts run side by side.

use crate::blocks::{BlockError, BlockScalar, StateProgram, fill_columns};

/// States per part: enough work to outweigh a task of `rayon`.
const PART: usize = 2048;

/// Fills columns of equal lengths `n`.
pub(crate) fn fill_in_parallel<T, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &[&[T]; INPUTS],
    outputs: &mut [&mut [T]; OUTPUTS],
    n: usize,
) -> Result<(), BlockError>
where
    T: BlockScalar + Send + Sync,
    P: StateProgram<T, INPUTS, OUTPUTS> + Sync,
{
    if n <= PART {
        return fill_columns(program, inputs, outputs);
    }
    // Parts start at full lines.
    let half = (n / 2).next_multiple_of(64);
    // Inputs that the program completes by itself are empty.
    let front = inputs.map(|input| &input[..half.min(input.len())]);
    let back = inputs.map(|input| &input[half.min(input.len())..]);
    let mut front_outputs = outputs.each_mut().map(|_| <&mut [T]>::default());
    let mut back_outputs = outputs.each_mut().map(|_| <&mut [T]>::default());
    for (k, output) in outputs.iter_mut().enumerate() {
        (front_outputs[k], back_outputs[k]) = output.split_at_mut(half);
    }
    let (first, second) = rayon::join(
        || fill_in_parallel(program, &front, &mut front_outputs, half),
        || fill_in_parallel(program, &back, &mut back_outputs, n - half),
    );
    first?;
    second.map_err(|error| match error {
        BlockError::At { sample, reason } => BlockError::At {
            sample: sample + half,
            reason,
        },
        other @ BlockError::Length { .. } => other,
    })
}
