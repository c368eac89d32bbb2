//! Aggregators and whole networks give what the official code gives, from its own keys.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

mod golden;

use std::path::Path;

use burn::module::Module;
use burn::store::ModuleSnapshot;
use burn::tensor::{Device, Tensor};
use vpr_nets::aggregate::{
    Boq, BoqConfig, ConvApConfig, CosPlaceConfig, CricaVprConfig, GemConfig, MixVprConfig,
    NetVladConfig, SaladConfig, cosplace, cricavpr, mixvpr, salad,
};
use vpr_nets::backbone::{DinoV2, DinoV2Config};
use vpr_nets::model;
use vpr_nets::regress::{self, DescriptorRegressorConfig};
use vpr_nets::weights::Weights;

/// Holds `forward` of `init` with the weights of the folder, in every format, against its outputs.
fn check<M: Module + ModuleSnapshot>(
    name: &str,
    rename: impl Fn(Weights) -> Weights,
    init: impl Fn(&Weights) -> M,
    hold: impl Fn(&M, &Path),
) {
    let Some(folder) = golden::folder(name) else { return };
    let all = golden::weights(&folder);
    assert!(!all.is_empty(), "no weights in {}", folder.display());
    for weights in all {
        let weights = rename(weights);
        let mut network = init(&weights);
        weights.apply(&mut network).unwrap();
        hold(&network, &folder);
    }
}

#[test]
fn gem_is_the_power_mean() {
    let device = Device::flex();
    let map = Tensor::<4>::from_data([[[[1.0, 2.0], [3.0, 4.0]]]], &device);
    let mean = GemConfig::new().init(&device).forward(map).into_scalar::<f32>();
    // ((1 + 8 + 27 + 64) / 4)^(1/3)
    assert!((mean - 25.0_f32.cbrt()).abs() < 1e-5, "{mean}");
}

#[test]
fn convap_keeps_the_cells_of_a_map_apart() {
    let device = Device::flex();
    device.seed(1);
    let mut config = ConvApConfig::new(3);
    (config.reduced, config.cells) = (5, [2, 2]);
    let head = config.init(&device);
    let map = Tensor::<4>::ones([1, 3, 4, 4], &device);
    let plain = head.forward(map.clone());
    assert_eq!(plain.dims(), [1, 5 * 2 * 2]);
    let norm = plain.clone().square().sum().sqrt().into_scalar::<f32>();
    assert!((norm - 1.0).abs() < 1e-5, "{norm}");
    let corner = map.slice_assign([0..1, 0..3, 0..1, 0..1], Tensor::zeros([1, 3, 1, 1], &device));
    let change = (head.forward(corner) - plain).abs().max().into_scalar::<f32>();
    assert!(change > 1e-4, "a corner makes no difference: {change}");
}

#[test]
fn cosplace_head_is_the_official_one() {
    check(
        "cosplace_head",
        |weights| cosplace::from_official(weights).unwrap(),
        |weights| CosPlaceConfig::from_weights(weights, "").unwrap().init(&Device::flex()),
        |head, folder| {
            let ours = head.forward(golden::tensor(folder, "input.features"));
            golden::assert_close(ours, folder, "output.descriptor");
        },
    );
}

#[test]
fn mixvpr_is_the_official_one() {
    check(
        "mixvpr",
        |weights| mixvpr::from_official(weights).unwrap(),
        |weights| MixVprConfig::from_weights(weights, "").unwrap().init(&Device::flex()),
        |head, folder| {
            let ours = head.forward(golden::tensor(folder, "input.features"));
            golden::assert_close(ours, folder, "output.descriptor");
        },
    );
}

#[test]
fn salad_is_the_official_one() {
    check(
        "salad",
        |weights| salad::from_official(weights).unwrap(),
        |weights| SaladConfig::from_weights(weights, "").unwrap().init(&Device::flex()),
        |head, folder| {
            let features = golden::tensor(folder, "input.features");
            let ours = head.forward(features, golden::tensor(folder, "input.token"));
            golden::assert_close(ours, folder, "output.descriptor");
        },
    );
}

#[test]
fn cricavpr_is_the_official_one_and_depends_on_its_batch() {
    check(
        "cricavpr_head",
        |weights| cricavpr::from_official(weights).unwrap(),
        |weights| {
            let config = CricaVprConfig::from_weights(weights, "").unwrap();
            config.with_heads(4).init(&Device::flex())
        },
        |head, folder| {
            let class = golden::tensor::<2>(folder, "input.cls");
            let patches = golden::tensor::<3>(folder, "input.patch");
            let [n, positions, dim] = patches.dims();
            let side = positions.isqrt();
            let map = patches.swap_dims(1, 2).reshape([n, dim, side, side]);
            let together = head.forward(class.clone(), map.clone()).for_this_batch();
            golden::assert_close(together.clone(), folder, "output.descriptor");
            let alone = head.forward(class.narrow(0, 0, 1), map.narrow(0, 0, 1)).for_this_batch();
            let change = (together.narrow(0, 0, 1) - alone).abs().max().into_scalar::<f32>();
            assert!(change > 1e-4, "a batch of one gives the same descriptor: {change:e}");
        },
    );
}

#[test]
fn netvlad_is_hlocs() {
    check(
        "netvlad_layer",
        |weights| weights,
        |weights| NetVladConfig::from_weights(weights, "").unwrap().init(&Device::flex()),
        |head, folder| {
            let ours = head.forward(golden::tensor(folder, "input.features"));
            golden::assert_close(ours, folder, "output.descriptor");
        },
    );
}

#[test]
fn descriptor_regressor_is_the_official_one() {
    check(
        "copr_regressor",
        regress::from_official,
        |weights| {
            DescriptorRegressorConfig::from_weights(weights, "").unwrap().init(&Device::flex())
        },
        |network, folder| {
            let anchor = golden::tensor(folder, "input.anchor");
            let ours = network.forward(anchor, golden::tensor(folder, "input.relative_pose"));
            golden::assert_close(ours, folder, "output.descriptor");
        },
    );
}

/// The miniatures have two heads of 32 channels, which no key tells.
fn miniature(weights: &Weights, prefix: &str) -> DinoV2 {
    let mut config = DinoV2Config::from_weights(weights, prefix).unwrap();
    config.heads = 2;
    config.init(&Device::flex())
}

fn dinov2(name: &str) {
    check(
        name,
        |weights| weights,
        |weights| miniature(weights, ""),
        |network, folder| {
            let image: Tensor<4> = golden::tensor(folder, "input.image");
            let tokens = network.forward(image.clone());
            golden::assert_close(tokens.class, folder, "output.cls");
            golden::assert_close(tokens.patches, folder, "output.patch");
            golden::assert_close(network.prenorm(image), folder, "output.prenorm");
        },
    );
}

#[test]
fn dinov2_is_the_official_one() {
    dinov2("dinov2_vit");
}

#[test]
fn dinov2_with_registers_is_the_official_one() {
    dinov2("dinov2_vit_reg4");
}

#[derive(Module, Debug)]
struct BoqOnDinoV2 {
    backbone: DinoV2,
    aggregator: Boq,
}

#[test]
fn boq_on_dinov2_is_the_official_one() {
    check(
        "boq_dinov2",
        |weights| weights.renamed(&[(r"^backbone\.dino\.", "backbone.")]).unwrap(),
        |weights| BoqOnDinoV2 {
            backbone: miniature(weights, "backbone."),
            aggregator: BoqConfig::from_weights(weights, "aggregator.")
                .unwrap()
                .init(&Device::flex()),
        },
        |network, folder| {
            let image = golden::tensor(folder, "input.image");
            let map = network.backbone.forward_unnormalised(image).map();
            let (descriptor, attention) = network.aggregator.forward_with_attention(map);
            golden::assert_close(descriptor, folder, "output.descriptor");
            for (layer, attention) in attention.into_iter().enumerate() {
                golden::assert_close(attention, folder, &format!("output.attention{layer}"));
            }
        },
    );
}

#[test]
fn a_network_is_opened_by_name_and_says_which_images_it_takes() {
    let Some(folder) = golden::folder("boq_dinov2") else { return };
    for weights in golden::weights(&folder) {
        let network = model::open("boq-dinov2", weights, &Device::flex()).unwrap().unwrap();
        let ours = network.describe(golden::tensor(&folder, "input.image"));
        assert_eq!(ours.dims(), [2, network.dimension()]);
        assert!(network.accepts(98, 112).is_ok());
        assert!(network.accepts(98, 99).is_err(), "99 is no multiple of 14");
    }
}

#[test]
fn every_network_refuses_the_weights_of_another_by_their_keys() {
    let Some(folder) = golden::folder("cosplace_head") else { return };
    for name in model::NAMES {
        let weights = Weights::open(&folder.join("weights.safetensors")).unwrap();
        let refused = model::open(name, weights, &Device::flex()).unwrap().err();
        let text = refused.unwrap_or_else(|| panic!("{name} takes them")).to_string();
        assert!(text.contains("weights.safetensors"), "{name}: {text}");
    }
}
