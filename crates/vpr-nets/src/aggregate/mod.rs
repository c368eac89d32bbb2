//! Aggregators: from the features of an image to its descriptor.

pub mod boq;
pub mod convap;
pub mod cosplace;
pub mod cricavpr;
pub mod gem;
mod mersenne;
pub mod mixvpr;
pub mod netvlad;
pub mod projection;
pub mod regions;
pub mod salad;
pub mod spp;
pub mod whitening;

pub use self::boq::{Boq, BoqConfig};
pub use self::convap::{ConvAp, ConvApConfig};
pub use self::cosplace::{CosPlace, CosPlaceConfig};
pub use self::cricavpr::{BatchDependent, CricaVpr, CricaVprConfig};
pub use self::gem::{Gem, GemConfig};
pub use self::mixvpr::{MixVpr, MixVprConfig};
pub use self::netvlad::{
    Centres, NetVlad, NetVladConfig, Order, PytorchNetVlad, PytorchNetVladConfig, VladForm, vlad,
};
pub use self::projection::GaussianProjection;
pub use self::regions::Regions;
pub use self::salad::{Salad, SaladConfig};
pub use self::spp::pyramid;
pub use self::whitening::Whitening;
pub use vpr_vision::vlad::{Vocabulary, VocabularyParams};
