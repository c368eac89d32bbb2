//! Generated counterparts of the six datasets of thesis table 5.2.

/// A generated world that takes the part of a published dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counterpart {
    /// Name of the dataset, as thesis table 5.2 has it.
    pub name: &'static str,
    /// The world, with its settings.
    pub world: &'static str,
}

/// The six, in the order of the table. Small images and maps, so that all of them are rendered and
/// described in about a minute; what makes each hard is that of its original: viewpoint and
/// look-alike facades in Pittsburgh and San Francisco, a suburb at other hours in St Lucia, grey
/// panoramas in Eynsham, night in Mapillary, the seasons in Nordland.
pub const COUNTERPARTS: [Counterpart; 6] = [
    Counterpart {
        name: "Pittsburgh",
        world: "world/street?places=150&camera.width=160&camera.height=120&street.look_alikes=3&street.aliasing=0.5",
    },
    Counterpart {
        name: "San Francisco",
        world: "world/street-aliased?seed=41&places=150&camera.width=160&camera.height=120",
    },
    Counterpart {
        name: "St Lucia",
        world: "world/street?seed=42&places=150&camera.width=160&camera.height=120&street.trees=0.9&street.styles=4&queries.condition.sun_elevation_deg=10.0&queries.condition.cloud=0.6",
    },
    Counterpart {
        name: "Eynsham",
        world: "world/street-grey?seed=43&places=150&camera.width=160&camera.height=120",
    },
    Counterpart {
        name: "MSLS",
        world: "world/street-night?seed=44&places=150&camera.width=160&camera.height=120",
    },
    Counterpart {
        name: "Nordland",
        world: "world/rail?places=150&camera.width=160&camera.height=120",
    },
];
