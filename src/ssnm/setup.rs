//! Before the first outer step: b, err⁰ and λ⁰, and for the algorithms as printed σ_max.

use super::dual_problem::DualProblem;
use super::gauge::Gauge;
use super::known::Known;
use super::newton::Newton;
use super::outer::Way;
use super::products::Products;
use super::scaling::Scaled;
use super::{Method, RecycledSubspace};
use crate::control::Stop;
use crate::dual::{DualError, LARGEST_MATRIX, spectrum};
use crate::sparse::{add_times, difference, norm_max};

impl<'a, const D: usize> Newton<'a, D> {
    /// Before the first product.
    pub fn new(
        dual: &'a DualProblem<'a, D>,
        operator: Scaled<'a>,
        stop: Stop<'a>,
        recycled: &mut RecycledSubspace,
    ) -> Self {
        let (problem, settings) = (&dual.problem, dual.settings);
        // A guess of the entries of diag(A), as if only their own unknowns moved: the first product replaces it.
        let own = problem.own_compliance().iter().enumerate();
        let mean = mean(own.map(|(i, c)| c * dual.factor(i) * dual.factor(i)));
        let products = Products::new(operator, problem.load_case(), settings, stop, mean);
        let known = (products.dual.matrix())
            .filter(|matrix| matrix.n_blocks() <= LARGEST_MATRIX)
            .filter(|_| settings.method == Method::Multisecant && dual.balance.is_none())
            .and_then(|matrix| Known::new(&matrix, settings.numbers.proximal));
        let mut surrogate = match settings.method {
            Method::Multisecant => std::mem::take(&mut recycled.surrogate),
            _ => Default::default(),
        };
        surrogate.prepare(mean, settings.numbers.pairs, &dual.compliance, &dual.scale);
        Self {
            dual,
            gauge: Gauge {
                dual,
                sigma: mean,
                moved: vec![0.0; D * problem.m()],
                squeeze: 0.0,
                blur: Vec::new(),
            },
            products,
            surrogate,
            hidden: 0,
            known,
            mean,
            certificate: None,
            check_accuracy: settings.tolerance,
        }
    }

    /// Finds σ_max, makes r, and moves to λ⁰.
    pub fn set_up(
        &mut self,
        way: &mut Way<D>,
        initial: Option<&[f64]>,
        recycled: &mut RecycledSubspace,
    ) -> Result<(), DualError> {
        let found = self.find_sigma(recycled);
        let outcome = found.and_then(|products| {
            way.n_a_sigma = products;
            self.start(way, initial)?;
            self.measure(way);
            self.keep_squeezed(way)
        });
        way.err0 = self.gauge.first_error(&way.first);
        outcome
    }

    /// Finds σ_max: on the surrogate from its products, otherwise by Lanczos, unless an earlier solve has done so.
    /// Returns the number of products.
    fn find_sigma(&mut self, recycled: &mut RecycledSubspace) -> Result<usize, DualError> {
        if self.dual.settings.method == Method::Multisecant {
            self.gauge.sigma = self.surrogate.largest();
            return Ok(0);
        }
        if let Some((sigma, mean)) = recycled.spectrum {
            (self.gauge.sigma, self.mean) = (sigma, mean);
            return Ok(0);
        }
        let project = |p: &mut [f64]| {
            if let Some(face) = &self.dual.balanced {
                face.project(p);
            }
        };
        let len = self.dual.offsets.len();
        let (dual, stop) = (&mut self.products.dual, &self.products.stop);
        let found = spectrum(|q, accuracy| dual.apply(q, accuracy, stop), len, project)?;
        (self.gauge.sigma, self.mean) = (found.largest, found.mean);
        recycled.spectrum = Some((found.largest, found.mean));
        Ok(found.products)
    }

    /// Computes r at the point of err⁰ and moves to λ⁰. If products of earlier solves cover the difference between the two,
    /// and the former would cost one, it is the other way round: err⁰ serves only as the reference. So it is where a similar A is known,
    /// unless λ⁰ seems to be far worse than none.
    fn start(&mut self, way: &mut Way<D>, initial: Option<&[f64]>) -> Result<(), DualError> {
        let target = initial.map(|initial| {
            let mut target = initial.to_vec();
            self.products.dual.divide(&mut target);
            self.dual.project(&mut target);
            target
        });
        let growth = self.dual.settings.numbers.growth;
        let costs = self.products.dual.operator.costs().is_some() || self.dual.balance.is_some();
        let Some(target) = target else {
            way.first.r = self.products.first(&way.first.lambda)?;
            way.point.clone_from(&way.first);
            return Ok(());
        };
        if costs && self.surrogate.is_known() {
            way.point.lambda.clone_from(&target);
            way.point.r = self.products.first(&way.point.lambda)?;
            let back = difference(&way.first.lambda, &way.point.lambda);
            way.first.r.clone_from(&way.point.r);
            add_times(1.0, &self.surrogate.times(&back), &mut way.first.r);
            self.measure(way);
            let is_near = self.surrogate.len() > 0
                || self.gauge.error(&way.point) <= growth * self.gauge.first_error(&way.first);
            if is_near {
                return Ok(());
            }
        }
        way.first.r = self.products.first(&way.first.lambda)?;
        self.measure(way);
        way.point.clone_from(&way.first);
        self.move_to(&mut way.point, target)?;
        self.refresh(&mut way.point, 0.0)?;
        // Where loads have changed much, the start may be far worse than none.
        if self.gauge.error(&way.point) > growth * self.gauge.first_error(&way.first) {
            way.point.clone_from(&way.first);
            self.refresh(&mut way.point, 0.0)?;
        }
        Ok(())
    }

    /// Measures how much is squeezed at the point of err⁰.
    fn measure(&mut self, way: &mut Way<D>) {
        let Some((lambda, err)) = self.gauge.squeeze_of(&way.first) else {
            return;
        };
        self.gauge.squeeze = err;
        way.squeezed = self.more_pressed(&lambda, &way.first.lambda);
    }

    /// The largest normal multipliers on bodies that bear forces at `more` and none at `less`; empty if there are none.
    fn more_pressed(&self, more: &[f64], less: &[f64]) -> Vec<f64> {
        let [mut more, less] = [more, less].map(|lambda| self.dual.pressed(lambda));
        let least = self.dual.settings.tolerance * norm_max(&more);
        for (more, less) in more.iter_mut().zip(less) {
            if less > least || *more <= least {
                *more = 0.0;
            }
        }
        match norm_max(&more) > 0.0 {
            true => more,
            false => Vec::new(),
        }
    }

    /// Leaves a start where squeezed bodies bear nothing, if that seems to be a solution, for the forces that squeeze them.
    fn keep_squeezed(&mut self, way: &mut Way<D>) -> Result<(), DualError> {
        let (settings, gauge) = (self.dual.settings, &self.gauge);
        let Some((squeezed, err)) = gauge.squeeze_of(&way.point) else {
            return Ok(());
        };
        let met = settings.tolerance * gauge.first_error(&way.first);
        if err > settings.numbers.growth * gauge.error(&way.point).max(met) {
            self.press(way, squeezed)?;
        }
        Ok(())
    }

    /// Leaves a point where squeezed bodies bear nothing for these forces; false if they press no further body.
    pub fn press(&mut self, way: &mut Way<D>, squeezed: Vec<f64>) -> Result<bool, DualError> {
        let presses = !self.more_pressed(&squeezed, &way.point.lambda).is_empty();
        if presses {
            way.apart = Some(way.point.clone());
            self.move_to(&mut way.point, squeezed)?;
        }
        Ok(presses)
    }
}

/// The mean of the positive values; 1 if there are none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values.filter(|&value| value > 0.0) {
        (sum, count) = (sum + value, count + 1);
    }
    if count == 0 { 1.0 } else { sum / count as f64 }
}
