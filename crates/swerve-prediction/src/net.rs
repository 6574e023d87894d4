//! Small neural nets: matrices, automatic differentiation and Adam.
//!
//! All computations are in `f32`, summed in a fixed order by one thread, with exponentials from `libm` or, for
//! inference of recurrent units, a polynomial: the same bits on every machine. Rows are examples, columns features.

mod adam;
mod forward;
#[cfg(test)]
pub(crate) mod gradients;
mod heads;
mod matrix;
mod tape;
#[cfg(test)]
mod tests;

pub(crate) use adam::Adam;
pub(crate) use heads::{Normal, distance, ln_sum};
pub(crate) use matrix::Matrix;
pub(crate) use tape::{Node, Tape};

use swerve_core::Rng;

/// A linear layer: index of its weights in a net's list; its bias follows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer(usize);

/// A gated recurrent unit (Cho et al. 2014): both gates in one layer, and the candidate state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gru {
    gates: Layer,
    new: Layer,
    size: usize,
}

/// Collects the shapes of a net's matrices, in the order of its file.
#[derive(Default)]
pub(crate) struct Shapes(Vec<[usize; 2]>);

impl Gru {
    /// Size of the state.
    pub(crate) fn size(&self) -> usize {
        self.size
    }
}

impl Shapes {
    /// Adds a layer from `inputs` to `outputs` numbers.
    pub(crate) fn layer(&mut self, inputs: usize, outputs: usize) -> Layer {
        self.0.extend([[inputs, outputs], [1, outputs]]);
        Layer(self.0.len() - 2)
    }

    /// Adds a recurrent unit with a state of `size` numbers.
    pub(crate) fn gru(&mut self, inputs: usize, size: usize) -> Gru {
        let gates = self.layer(inputs + size, 2 * size);
        Gru { gates, new: self.layer(inputs + size, size), size }
    }

    /// Collected shapes.
    pub(crate) fn list(self) -> Vec<[usize; 2]> {
        self.0
    }
}

/// Initial weights: normal with standard deviation √(2/inputs) per layer (He et al. 2015), a tenth of that in the
/// last layer; biases are zero.
pub(crate) fn drawn(shapes: &[[usize; 2]], seed: u64) -> Vec<Matrix> {
    let one = |(k, [rows, columns]): (usize, &[usize; 2])| {
        let mut rng = Rng::keyed(seed, "weights", &[k as i64]);
        let last = if k + 2 == shapes.len() { 0.1 } else { 1.0 };
        let deviation = if *rows == 1 { 0.0 } else { last * (2.0 / *rows as f64).sqrt() };
        let values = (0..rows * columns).map(|_| (deviation * rng.normal()) as f32).collect();
        Matrix::new(*rows, *columns, values)
    };
    shapes.iter().enumerate().map(one).collect()
}
