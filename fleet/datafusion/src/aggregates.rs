//! Aggregate functions of DataFusion over a plan: samples or summaries go in, summaries or parameters come out.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use datafusion::arrow::array::{Array, ArrayRef, BinaryArray, Float64Array, StructArray, UInt64Array};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::{DataType, Field, FieldRef, Fields};
use datafusion::common::{Result, ScalarValue, exec_err};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{Accumulator, AggregateUDFImpl, Signature, TypeSignature, Volatility};
use modelmill_fleet::{FleetModel, FleetSummary};

use crate::samples::{GroupSamples, external_error};

/// The result of an aggregate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AggregateKind {
    /// `modelmill_summarise`: the summary of samples, as bytes.
    Summary,
    /// `modelmill_merge`: the sum of summaries, as bytes.
    Merged,
    /// `modelmill_identify`: the parameters from samples or summaries.
    Parameters,
}

impl AggregateKind {
    /// Name of the function in SQL.
    fn name(self) -> &'static str {
        match self {
            Self::Summary => "modelmill_summarise",
            Self::Merged => "modelmill_merge",
            Self::Parameters => "modelmill_identify",
        }
    }
}

/// An aggregate over a plan.
#[derive(Clone)]
pub struct FleetAggregate {
    /// The plan with its derived model.
    ground: Arc<FleetModel>,
    /// The result.
    answer: AggregateKind,
    /// Types of the arguments.
    signature: Signature,
    /// Names of the columns of samples, in the order of the arguments.
    columns: Vec<String>,
}

impl FleetAggregate {
    /// The aggregate with a kind of result.
    pub fn new(ground: Arc<FleetModel>, answer: AggregateKind) -> Self {
        // Samples are the name of a recording and its columns; summaries are bytes.
        let columns = ground.columns();
        let numbers = vec![DataType::Float64; columns.len()];
        let samples = TypeSignature::Exact([vec![DataType::Utf8], numbers].concat());
        let summaries = TypeSignature::Exact(vec![DataType::Binary]);
        let signature = match answer {
            AggregateKind::Summary => samples,
            AggregateKind::Merged => summaries,
            AggregateKind::Parameters => TypeSignature::OneOf(vec![summaries, samples]),
        };
        Self {
            ground,
            answer,
            signature: Signature::new(signature, Volatility::Immutable),
            columns,
        }
    }

    /// Fields of the parameters: `recordings`, `bad`, then for each parameter its value and standard deviation `_std`,
    /// null if the recordings do not determine it.
    fn fields(&self) -> Fields {
        let counts = ["recordings", "bad"].map(|name| Field::new(name, DataType::UInt64, true));
        let parameters = self.ground.parameters();
        let parameters = parameters.iter().flat_map(|info| {
            [info.name.clone(), format!("{}_std", info.name)].map(|name| Field::new(name, DataType::Float64, true))
        });
        counts.into_iter().chain(parameters).collect()
    }
}

impl fmt::Debug for FleetAggregate {
    /// Shows the name of the function.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.answer.name())
    }
}

impl PartialEq for FleetAggregate {
    /// Equal aggregates have the same result and the same plan.
    fn eq(&self, other: &Self) -> bool {
        self.answer == other.answer && self.ground.mark() == other.ground.mark()
    }
}

impl Eq for FleetAggregate {}

impl Hash for FleetAggregate {
    /// Consistent with the comparison.
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.answer.hash(state);
        self.ground.mark().hash(state);
    }
}

impl AggregateUDFImpl for FleetAggregate {
    fn name(&self) -> &str {
        self.answer.name()
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    /// Bytes for summaries, a struct for parameters.
    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(match self.answer {
            AggregateKind::Summary | AggregateKind::Merged => DataType::Binary,
            AggregateKind::Parameters => DataType::Struct(self.fields()),
        })
    }

    /// The state of a group. More than one argument means samples.
    fn accumulator(&self, args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        if args.is_distinct {
            return exec_err!(
                "{}(DISTINCT ...) is not supported, because equal samples must all be used; remove DISTINCT",
                self.name()
            );
        }
        Ok(Box::new(SummaryAccumulator {
            fleet: self.clone(),
            samples: GroupSamples::default(),
            sum: None,
            of_samples: args.expr_fields.len() > 1,
        }))
    }

    /// Partitions exchange states as bytes.
    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        Ok(vec![Arc::new(Field::new(
            format!("{}[state]", args.name),
            DataType::Binary,
            true,
        ))])
    }
}

/// The state of one group.
#[derive(Debug)]
struct SummaryAccumulator {
    /// The aggregate.
    fleet: FleetAggregate,
    /// Samples so far, if the arguments are samples.
    samples: GroupSamples,
    /// Sum of the summaries so far, if the arguments are summaries.
    sum: Option<FleetSummary>,
    /// Whether the arguments are samples.
    of_samples: bool,
}

impl SummaryAccumulator {
    /// Adds a summary; fails if it belongs to another plan.
    fn add(&mut self, bytes: &[u8]) -> Result<()> {
        // A summary of another plan cannot be added.
        let one = FleetSummary::from_bytes(bytes).map_err(external_error)?;
        self.fleet.ground.check_plan(&one).map_err(external_error)?;
        match &mut self.sum {
            None => self.sum = Some(one),
            Some(sum) => sum.merge(&one).map_err(external_error)?,
        }
        Ok(())
    }

    /// Calls `look` for each summary of a column; null values are skipped.
    fn for_each_summary(values: &[ArrayRef], look: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let Some(column) = values.first() else {
            return exec_err!("an argument is missing; give a column of summaries");
        };
        // The engine may have bytes in another type.
        let column = cast(column, &DataType::Binary)?;
        let Some(column) = column.as_any().downcast_ref::<BinaryArray>() else {
            return exec_err!("summaries are bytes; give the result of `modelmill_summarise`");
        };
        column.iter().flatten().try_for_each(look)
    }

    /// The summary of the group. Samples are summarised only here, because all samples of a recording are needed.
    fn finish_sum(&mut self) -> Result<Option<FleetSummary>> {
        if self.of_samples {
            let fleet = self.fleet.clone();
            return self.samples.summary(&fleet.ground, &fleet.columns).map(Some);
        }
        Ok(self.sum.take())
    }
}

impl Accumulator for SummaryAccumulator {
    /// Adds rows of the table.
    fn update_batch(&mut self, values: &[ArrayRef]) -> Result<()> {
        if self.of_samples {
            self.samples.add(values)
        } else {
            Self::for_each_summary(values, |bytes| self.add(bytes))
        }
    }

    /// Adds states of other partitions.
    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        Self::for_each_summary(states, |bytes| {
            if self.of_samples {
                self.samples.add_bytes(bytes)
            } else {
                self.add(bytes)
            }
        })
    }

    /// The state as bytes; it is consumed.
    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        let bytes = if self.of_samples {
            Some(self.samples.bytes())
        } else {
            self.sum.take().map(|sum| sum.bytes())
        };
        Ok(vec![ScalarValue::Binary(bytes)])
    }

    /// The result of the group.
    fn evaluate(&mut self) -> Result<ScalarValue> {
        let sum = self.finish_sum()?;
        match self.fleet.answer {
            AggregateKind::Summary | AggregateKind::Merged => Ok(ScalarValue::Binary(sum.map(|sum| sum.bytes()))),
            AggregateKind::Parameters => {
                let sum = sum.unwrap_or_else(|| self.fleet.ground.empty_summary());
                // A group without a usable recording has counts and no parameters.
                let fit = self.fleet.ground.solve(&sum).ok();
                let n = self.fleet.ground.parameters().len();
                let mut columns: Vec<ArrayRef> = vec![
                    Arc::new(UInt64Array::from(vec![sum.recordings])),
                    Arc::new(UInt64Array::from(vec![sum.bad.len() as u64])),
                ];
                for k in 0..n {
                    // Value and standard deviation; both are null if not determined.
                    let fitted = fit.as_ref().map(|fit| fit.parameters[k]);
                    columns.push(Arc::new(Float64Array::from(vec![fitted.map(|fitted| fitted.value)])));
                    columns.push(Arc::new(Float64Array::from(vec![fitted.and_then(|fitted| fitted.std)])));
                }
                let answer = StructArray::try_new(self.fleet.fields(), columns, None)?;
                Ok(ScalarValue::Struct(Arc::new(answer)))
            }
        }
    }

    /// Memory of the group, bytes.
    fn size(&self) -> usize {
        let sum = self.sum.as_ref().map_or(0, |sum| 8 * sum.all_columns.gram.len());
        size_of_val(self) + self.samples.size() + sum
    }
}
