//! Eq. (9) on the model file's own values: random states around the nominal pose go in, the
//! numeric rank of the stacked regressor comes out. A statement about these values and samples,
//! beside the exact one about all values.

use std::cmp::Ordering;

use modelmill_codegen::review::NumericRank;
use modelmill_codegen::{Evaluator, PoseFault, States};
use modelmill_identify::numeric_rank::numeric_rank;
use modelmill_spec::Motion;

use crate::model::Model;
use crate::progress::watched;
use crate::table::count;

/// Fewest random states.
const SAMPLES: usize = 40;
/// Largest step from the nominal pose, rad and m; smaller where loops would not close.
const REACH: f64 = 1.0;
/// Ranges of rates and accelerations, per s and s^2, and of loads, N or N m.
const RATE: f64 = 2.0;
const ACCELERATION: f64 = 5.0;
const LOAD: f64 = 100.0;

/// The rank of H on the file's values, and in words where it says something else than exact reduction.
pub(crate) fn judged_rank(model: &Model) -> (Option<NumericRank>, Option<String>) {
    let message = format!("sampling {}", model.name);
    let found = match watched(&message, 0, |_| sampled_rank(model)) {
        Ok(found) => found,
        Err(reason) => {
            let says = format!("the numeric rank of eq. (9) was not found: {reason}");
            return (None, Some(says));
        }
    };
    let exact = model.base.len();
    let says = match found.rank.cmp(&exact) {
        Ordering::Less => Some(format!(
            "with the file's values the numeric rank is {}, below the exact {exact} for general values; special values \
             make columns vanish or coincide, so identification will find {} undetermined",
            found.rank,
            count(exact - found.rank, "direction", "directions")
        )),
        Ordering::Greater => Some(format!(
            "the numeric rank is {}, above the exact {exact}; please report this model, one of them is wrong",
            found.rank
        )),
        Ordering::Equal => None,
    };
    (Some(found), says)
}

/// The rank of H on the file's values; the reason in words if there is none.
fn sampled_rank(model: &Model) -> Result<NumericRank, String> {
    let mechanism = &model.derivation.mechanism;
    let active: Vec<(f64, Motion)> = mechanism
        .coordinates
        .iter()
        .filter(|c| !c.passive)
        .map(|c| (c.nominal, c.motion))
        .collect();
    let n_drives = mechanism.drives.len().max(1);
    let n_products = model.derivation.reduction.products.len();
    if n_products == 0 {
        return Err("no product of parameters has an effect on the drives".to_owned());
    }
    let samples = SAMPLES.max((4 * n_products).div_ceil(n_drives));
    let evaluator = Evaluator::new(&model.derivation);
    let mut draws = Draws(0x6d69_6c6c);
    let mut columns: [Vec<Vec<f64>>; 4] = [active.len(), active.len(), active.len(), n_drives]
        .map(|n| vec![Vec::with_capacity(samples); n]);
    let mut reach = REACH;
    let mut refused = 0;
    while columns[1].first().map_or(0, Vec::len) < samples {
        let q: Vec<f64> = active
            .iter()
            .map(|(nominal, motion)| {
                let reach = match motion {
                    Motion::Revolute => reach,
                    Motion::Prismatic => 0.5 * reach,
                };
                nominal + reach * draws.next()
            })
            .collect();
        let zero = vec![0.0; active.len().max(n_drives)];
        let still = States {
            q: q.iter().map(std::slice::from_ref).collect(),
            qd: zero[..active.len()]
                .iter()
                .map(std::slice::from_ref)
                .collect(),
            qdd: zero[..active.len()]
                .iter()
                .map(std::slice::from_ref)
                .collect(),
            load: zero[..n_drives].iter().map(std::slice::from_ref).collect(),
        };
        if evaluator.full_regressor(&still).is_err() {
            refused += 1;
            if refused > 20 * samples {
                return Err(format!(
                    "no poses were found around the nominal one at which the mechanism can stand ({refused} tried)"
                ));
            }
            reach = (reach * 0.97).max(0.02);
            continue;
        }
        for (column, value) in columns[0].iter_mut().zip(q) {
            column.push(value);
        }
        for (set, range) in columns[1..].iter_mut().zip([RATE, ACCELERATION, LOAD]) {
            for column in set {
                column.push(range * draws.next());
            }
        }
    }
    let slices = |k: usize| columns[k].iter().map(Vec::as_slice).collect();
    let states = States {
        q: slices(0),
        qd: slices(1),
        qdd: slices(2),
        load: slices(3),
    };
    let rank_of = |matrix: Result<_, PoseFault>| {
        let matrix = matrix.map_err(|fault| fault.to_string())?;
        numeric_rank(&matrix).map_err(|error| error.to_string())
    };
    let full = rank_of(evaluator.full_regressor(&states))?;
    let retained = rank_of(evaluator.regressor(&states))?;
    Ok(NumericRank {
        rank: full.rank,
        samples,
        condition: Some(retained.condition_number).filter(|c| c.is_finite()),
    })
}

/// Uniform numbers in (-1, 1), the same on every machine (Steele et al., `SplitMix`, 2014).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
