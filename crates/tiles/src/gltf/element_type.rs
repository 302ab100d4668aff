//! What the elements of an accessor are.

use gltf::json::accessor::{ComponentType, Type};

use crate::gltf::meshopt::PackedFilter;

/// What the elements of an accessor are.
#[derive(Clone, Copy)]
pub(crate) struct ElementType {
    pub(crate) component: ComponentType,
    pub(crate) shape: Type,
    pub(crate) normalized: bool,
    /// The least and the greatest element, component by component.
    pub(crate) bounds: Option<[[f32; 3]; 2]>,
    pub(crate) filter: Option<PackedFilter>,
}

impl ElementType {
    pub(crate) fn new(component: ComponentType, shape: Type) -> ElementType {
        ElementType { component, shape, normalized: false, bounds: None, filter: None }
    }

    pub(crate) fn normalized(component: ComponentType, shape: Type) -> ElementType {
        ElementType { normalized: true, ..ElementType::new(component, shape) }
    }

    pub(crate) fn position(bounds: [[f32; 3]; 2]) -> ElementType {
        ElementType { bounds: Some(bounds), ..ElementType::new(ComponentType::F32, Type::Vec3) }
    }

    pub(crate) fn filtered(self, filter: PackedFilter) -> ElementType {
        ElementType { filter: Some(filter), ..self }
    }

    /// Returns the bytes of an element without padding.
    pub(crate) fn size(&self) -> usize {
        self.component.size() * self.shape.multiplicity()
    }
}
