<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>
<qgis version="3.22.0" styleCategories="Symbology|Labeling|Fields|MapTips|Rendering">
  <renderer-v2 type="categorizedSymbol" attr="percent" symbollevels="0" enableorderby="0" forceraster="0">
    <categories>
      <category symbol="0" value="68" label="68 %" render="true"/>
      <category symbol="1" value="95" label="95 %" render="true"/>
    </categories>
    <symbols>
    <symbol name="0" type="fill" alpha="1" clip_to_extent="1" force_rhr="0">
      <layer class="SimpleFill" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="color" type="QString" value="31,100,180,{{area_opacity}}"/>
          <Option name="style" type="QString" value="solid"/>
          <Option name="outline_color" type="QString" value="31,100,180,230"/>
          <Option name="outline_style" type="QString" value="solid"/>
          <Option name="outline_width" type="QString" value="0.35"/>
          <Option name="outline_width_unit" type="QString" value="MM"/>
        </Option>
      </layer>
    </symbol>
    <symbol name="1" type="fill" alpha="1" clip_to_extent="1" force_rhr="0">
      <layer class="SimpleFill" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="color" type="QString" value="31,100,180,0"/>
          <Option name="style" type="QString" value="no"/>
          <Option name="outline_color" type="QString" value="31,100,180,200"/>
          <Option name="outline_style" type="QString" value="dash"/>
          <Option name="outline_width" type="QString" value="0.3"/>
          <Option name="outline_width_unit" type="QString" value="MM"/>
        </Option>
      </layer>
    </symbol>
    </symbols>
  </renderer-v2>
  <labeling type="none"/>
  <blendMode>0</blendMode>
  <featureBlendMode>0</featureBlendMode>
  <layerOpacity>1</layerOpacity>
  <aliases>{{aliases}}</aliases>
  <previewExpression>"name"</previewExpression>
  <mapTip>{{map_tip}}</mapTip>
</qgis>
