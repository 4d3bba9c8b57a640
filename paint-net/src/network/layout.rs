//! Parameters of a network as named tensors, and back.

use std::ops::Range;

use super::safetensors::Tensor;
use crate::error::Error;

/// A tensor's name, its extents, and where its values lie among the parameters.
pub(crate) type Part = (String, Vec<usize>, Range<usize>);

/// The tensor of a name.
pub(crate) fn find<'a>(tensors: &'a [Tensor], name: &str) -> Result<&'a Tensor, Error> {
    let found = tensors.iter().find(|t| t.name == name);
    found.ok_or_else(|| Error::Weights(format!("there is no tensor {name}")))
}

/// The parameters of a network whose `parts` cover them; refuses other extents and numbers that are not finite.
pub(crate) fn parameters(tensors: &[Tensor], parts: &[Part]) -> Result<Vec<f32>, Error> {
    let mut all = vec![0.0; parts.iter().map(|part| part.2.end).max().unwrap_or(0)];
    for (name, extents, range) in parts {
        let tensor = find(tensors, name)?;
        if &tensor.shape != extents {
            return Err(Error::Weights(format!("{name} has the extents {:?}, not {extents:?}", tensor.shape)));
        }
        if let Some(value) = tensor.values.iter().find(|v| !v.is_finite()) {
            return Err(Error::Weights(format!("{name} holds {value}")));
        }
        all[range.clone()].copy_from_slice(&tensor.values);
    }
    Ok(all)
}

/// The tensors of parameters.
pub(crate) fn tensors(parameters: &[f32], parts: Vec<Part>) -> Vec<Tensor> {
    let tensor = |(name, shape, range): Part| Tensor { name, shape, values: parameters[range].to_vec() };
    parts.into_iter().map(tensor).collect()
}
